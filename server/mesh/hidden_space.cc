#include "server/mesh/hidden_space.h"

#include <cstdint>
#include <utility>
#include <vector>

#include "server/mesh/grid_flood.h"

namespace romap::mesh {
namespace {

enum State : uint8_t { kUntouched, kOpen, kClosed };

class HiddenSpace {
 public:
  HiddenSpace(FieldGrid& grid, VisibilityTester& visibility)
      : grid_(grid), visibility_(visibility), state_(grid.value.size(), kUntouched) {}

  void Fill() {
    Flood(grid_, OpenNodesOnBox(), [this](size_t node) { return Enter(node); });
    for (size_t i = 0; i < state_.size(); ++i) {
      if (state_[i] != kOpen && IsSpace(i)) grid_.Edit(i, kSolid);
    }
  }

 private:
  bool IsSpace(size_t node) const { return !(grid_.value[node] > 0) && grid_.value[node] != kBeyondBox; }

  bool Enter(size_t node) {
    if (state_[node] != kUntouched || !IsSpace(node)) return false;
    const bool open = grid_.value[node] == kEmpty || !visibility_.has_views() || visibility_.IsVisible(node);
    state_[node] = open ? kOpen : kClosed;
    return open;
  }

  std::vector<size_t> OpenNodesOnBox() {
    std::vector<size_t> open;
    const Eigen::Vector3i last = grid_.nodes.array() - 2;
    for (int z = 1; z <= last.z(); ++z) {
      for (int y = 1; y <= last.y(); ++y) {
        const bool whole_row = z == 1 || z == last.z() || y == 1 || y == last.y();
        for (int x = 1; x <= last.x(); x += whole_row ? 1 : last.x() - 1) {
          if (Enter(grid_.Index(x, y, z))) open.push_back(grid_.Index(x, y, z));
        }
      }
    }
    return open;
  }

  FieldGrid& grid_;
  VisibilityTester& visibility_;
  std::vector<uint8_t> state_;
};

}  // namespace

void FillHiddenSpace(FieldGrid& grid, VisibilityTester& visibility) { HiddenSpace(grid, visibility).Fill(); }

}  // namespace romap::mesh
