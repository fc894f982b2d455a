#pragma once

#include <cstddef>

#include "server/mesh/field_grid.h"

namespace romap::mesh {

// Empties all matter but that of the largest piece, and of pieces with at least `min_share` of its nodes. What hangs
// together through nodes above `connect_value` (<= 0), over edges or corners of cells, is one piece, so that a stem
// that is thinner than a cell or dips below the surface's value still holds both its ends. Size counts nodes inside the
// surface. Returns how many of them remain.
size_t RemoveFloaters(FieldGrid& grid, float connect_value, double min_share);

}  // namespace romap::mesh
