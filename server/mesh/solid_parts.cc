#include "server/mesh/solid_parts.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace romap {
namespace {

using Steps = std::array<ptrdiff_t, 6>;

Steps NeighbourSteps(const FieldGrid& grid) {
  const auto y = static_cast<ptrdiff_t>(grid.StrideY());
  const auto z = static_cast<ptrdiff_t>(grid.StrideZ());
  return {-1, 1, -y, y, -z, z};
}

// Visits everything that can be reached from the nodes on `stack`. `enter(node)` says whether to go on from a node, and
// must say yes at most once per node. Nodes of the outermost ring must never be entered: they lack neighbours.
template <class Enter>
void Flood(const Steps& steps, std::vector<size_t>& stack, Enter enter) {
  while (!stack.empty()) {
    const size_t node = stack.back();
    stack.pop_back();
    for (const ptrdiff_t step : steps) {
      if (enter(node + step)) stack.push_back(node + step);
    }
  }
}

template <class Visit>
void ForEachInnerNode(const FieldGrid& grid, Visit visit) {
  const int last = grid.nodes_per_side - 2;
  for (int z = 1; z <= last; ++z) {
    for (int y = 1; y <= last; ++y) {
      for (int x = 1; x <= last; ++x) {
        const bool on_box_face = x == 1 || y == 1 || z == 1 || x == last || y == last || z == last;
        visit(grid.Index(x, y, z), on_box_face);
      }
    }
  }
}

}  // namespace

void FillCavities(FieldGrid& grid, float level) {
  // 1 = solid, or reached from outside. The ring counts as reached, so the flood stays within the box.
  std::vector<uint8_t> settled(grid.raw.size(), 1);
  std::vector<size_t> stack;
  ForEachInnerNode(grid, [&](size_t node, bool on_box_face) {
    const bool empty = !(grid.raw[node] > level);
    settled[node] = !empty || on_box_face;
    if (empty && on_box_face) stack.push_back(node);
  });
  Flood(NeighbourSteps(grid), stack, [&](size_t node) {
    if (settled[node]) return false;
    settled[node] = 1;
    return true;
  });
  for (size_t node = 0; node < settled.size(); ++node) {
    if (!settled[node]) grid.raw[node] = level + kSolidMargin;
  }
}

size_t RemoveFloaters(FieldGrid& grid, float level, float connect_level, double min_share) {
  constexpr uint32_t kNoPiece = 0;
  std::vector<uint32_t> piece_of(grid.raw.size(), kNoPiece);
  std::vector<size_t> piece_size = {0};  // nodes above `level`, by piece; [kNoPiece] unused
  const Steps steps = NeighbourSteps(grid);
  std::vector<size_t> stack;
  ForEachInnerNode(grid, [&](size_t seed, bool) {
    if (!(grid.raw[seed] > connect_level) || piece_of[seed] != kNoPiece) return;
    const auto piece = static_cast<uint32_t>(piece_size.size());
    piece_size.push_back(0);
    const auto enter = [&](size_t node) {
      if (!(grid.raw[node] > connect_level) || piece_of[node] != kNoPiece) return false;
      piece_of[node] = piece;
      piece_size[piece] += grid.raw[node] > level;
      return true;
    };
    enter(seed);
    stack.push_back(seed);
    Flood(steps, stack, enter);
  });

  const auto largest = static_cast<double>(*std::max_element(piece_size.begin(), piece_size.end()));
  size_t remaining = 0;
  for (size_t node = 0; node < piece_of.size(); ++node) {
    if (!(grid.raw[node] > level)) continue;
    const auto size = static_cast<double>(piece_size[piece_of[node]]);
    if (size < largest && size < min_share * largest) {
      grid.raw[node] = kEmptyRaw;
    } else {
      ++remaining;
    }
  }
  return remaining;
}

}  // namespace romap
