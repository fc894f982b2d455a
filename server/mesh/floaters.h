#pragma once

#include <cstddef>

#include "server/mesh/field_grid.h"

namespace romap::mesh {

// Empties all connected components except the largest and those with at least `min_share` of its size. Nodes above
// `connect_value` (<= 0) are connected over faces, edges and corners of cells, so that a stem that is thinner than a
// cell, or below the surface value, still connects its ends. The size of a component is its number of nodes inside the
// surface. Returns the number of nodes inside the surface that remain.
size_t RemoveFloaters(FieldGrid& grid, float connect_value, double min_share);

}  // namespace romap::mesh
