#pragma once

#include <cstddef>

#include "server/mesh/field_grid.h"

namespace romap {

// Empties all nodes above `level` but those of the largest piece, and of pieces with at least `min_share` of its nodes.
// What hangs together through nodes above `connect_level` (<= level; six neighbours) is one piece, so that a thin stem
// that dips below the level still holds both its ends. Size counts nodes above `level`. Returns the number of nodes
// above `level` that remain.
size_t RemoveFloaters(FieldGrid& grid, float level, float connect_level, double min_share);

}  // namespace romap
