#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "server/mesh/field_grid.h"

namespace romap::mesh {

// Index steps to the six neighbours of a node.
inline std::array<ptrdiff_t, 6> NeighbourSteps(const FieldGrid& grid) {
  const auto y = static_cast<ptrdiff_t>(grid.StrideY());
  const auto z = static_cast<ptrdiff_t>(grid.StrideZ());
  return {-1, 1, -y, y, -z, z};
}

// Visits all that can be reached from the nodes on `stack`. `enter(node)` says whether to go on from a node, and must
// say yes at most once per node and never for a node of the ring, which lacks neighbours.
template <class Enter>
void Flood(const FieldGrid& grid, std::vector<size_t> stack, Enter enter) {
  const std::array<ptrdiff_t, 6> steps = NeighbourSteps(grid);
  while (!stack.empty()) {
    const size_t node = stack.back();
    stack.pop_back();
    for (const ptrdiff_t step : steps) {
      if (enter(node + step)) stack.push_back(node + step);
    }
  }
}

}  // namespace romap::mesh
