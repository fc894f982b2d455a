#include "server/mesh/hidden_space.h"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "server/mesh/grid_flood.h"
#include "server/mesh/sight_tester.h"

namespace romap {

void FillHiddenSpace(FieldGrid& grid, float level, std::span<const Eigen::Vector3f> view_centers,
                     double max_optical_depth) {
  // Only nodes next to open space are tested for sight: the surface lies there, and tests are what takes the time.
  SightTester sight(grid, level, view_centers, static_cast<float>(max_optical_depth));
  enum State : uint8_t { kUntouched, kOpen, kClosed };
  std::vector<uint8_t> state(grid.raw.size(), kUntouched);
  const auto enter = [&](size_t index) {
    const float raw = grid.raw[index];
    if (state[index] != kUntouched || raw > level || raw == kBeyondBoxRaw) return false;
    const bool open = raw == kEmptyRaw || !sight.has_views() || sight.IsSeen(grid.NodeAt(index));
    state[index] = open ? kOpen : kClosed;
    return open;
  };

  std::vector<size_t> open_on_box;
  const int last = grid.nodes_per_side - 2;
  for (int z = 1; z <= last; ++z) {
    for (int y = 1; y <= last; ++y) {
      const bool whole_row = z == 1 || z == last || y == 1 || y == last;
      for (int x = 1; x <= last; x += whole_row ? 1 : last - 1) {
        if (enter(grid.Index(x, y, z))) open_on_box.push_back(grid.Index(x, y, z));
      }
    }
  }
  Flood(grid, std::move(open_on_box), enter);
  for (size_t i = 0; i < state.size(); ++i) {
    if (state[i] != kOpen && !(grid.raw[i] > level) && grid.raw[i] != kBeyondBoxRaw) grid.raw[i] = level + kSolidMargin;
  }
}

}  // namespace romap
