#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "server/mesh/field_grid.h"

namespace romap::mesh {

// Index steps to the six neighbors of a node.
inline std::array<ptrdiff_t, 6> NeighborSteps(const FieldGrid& grid) {
  const auto y = static_cast<ptrdiff_t>(grid.StrideY());
  const auto z = static_cast<ptrdiff_t>(grid.StrideZ());
  return {-1, 1, -y, y, -z, z};
}

// Flood fill from the nodes on `stack` over six neighbors. `enter(node)` returns whether to continue from a node; it
// must return true at most once per node and never for a node of the ring, which lacks neighbors.
template <class Enter>
void Flood(const FieldGrid& grid, std::vector<size_t> stack, Enter enter) {
  const std::array<ptrdiff_t, 6> steps = NeighborSteps(grid);
  while (!stack.empty()) {
    const size_t node = stack.back();
    stack.pop_back();
    for (const ptrdiff_t step : steps) {
      if (enter(node + step)) stack.push_back(node + step);
    }
  }
}

}  // namespace romap::mesh
