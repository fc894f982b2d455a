#include "server/mesh/hidden_space.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "server/mesh/grid_flood.h"

namespace romap {
namespace {

// exp of less than this adds nothing over the few steps through a box.
constexpr float kTransparentRaw = -8.0f;
// Keeps exp finite; far above any level in use.
constexpr float kOpaqueRaw = 20.0f;

// Answers whether any view sees a node. Rays advance by the smallest node spacing, and the node nearest to each step
// speaks for it.
class SightTester {
 public:
  SightTester(const FieldGrid& grid, float level, std::span<const Eigen::Vector3f> view_centers,
              float max_optical_depth)
      : grid_(grid), step_mu_(grid.spacing.minCoeff()), max_optical_depth_(max_optical_depth) {
    for (const Eigen::Vector3f& center : view_centers) {
      const Eigen::Vector3f view = (center - grid.origin).cwiseQuotient(grid.spacing);
      if (view.allFinite()) views_.push_back(view);
    }
    const float step_per_side = step_mu_ / grid.longest_side_mu;
    optical_depth_.assign(grid.raw.size(), 0.0f);
    for (size_t i = 0; i < grid.raw.size(); ++i) {
      const float raw = grid.raw[i];
      if (raw > level) {
        optical_depth_[i] = 2.0f * max_optical_depth;
      } else if (raw > kTransparentRaw) {
        optical_depth_[i] = std::exp(std::min(raw, kOpaqueRaw)) * step_per_side;
      }
    }
  }

  bool IsSeen(const Eigen::Vector3f& node) {
    if (views_.empty()) return true;
    // Neighbours are mostly seen by the same view, so the last one to see anything goes first.
    for (size_t tried = 0; tried < views_.size(); ++tried) {
      const size_t view = (last_view_ + tried) % views_.size();
      if (Sees(views_[view], node)) {
        last_view_ = view;
        return true;
      }
    }
    return false;
  }

 private:
  bool Sees(const Eigen::Vector3f& view, const Eigen::Vector3f& node) const {
    const Eigen::Vector3f way = view - node;
    const float way_mu = way.cwiseProduct(grid_.spacing).norm();
    if (!(way_mu > step_mu_)) return true;
    const Eigen::Vector3f step = way * (step_mu_ / way_mu);
    const int steps = StepsWithinGrid(node, step, way_mu);
    Eigen::Vector3f at = node + Eigen::Vector3f::Constant(0.5f);  // so that truncation rounds to the nearest node
    float depth = 0;
    for (int i = 0; i < steps; ++i) {
      at += step;
      depth +=
          optical_depth_[grid_.Index(static_cast<int>(at.x()), static_cast<int>(at.y()), static_cast<int>(at.z()))];
      if (depth > max_optical_depth_) return false;
    }
    return true;
  }

  // Whole steps from `node` that stay among the grid's nodes and do not pass the view.
  int StepsWithinGrid(const Eigen::Vector3f& node, const Eigen::Vector3f& step, float way_mu) const {
    float steps = way_mu / step_mu_;
    const auto last = static_cast<float>(grid_.nodes_per_side - 1);
    for (int axis = 0; axis < 3; ++axis) {
      if (step[axis] == 0) continue;
      steps = std::min(steps, ((step[axis] > 0 ? last : 0.0f) - node[axis]) / step[axis]);
    }
    return static_cast<int>(steps);
  }

  const FieldGrid& grid_;
  const float step_mu_;
  const float max_optical_depth_;
  std::vector<Eigen::Vector3f> views_;  // in node coordinates
  std::vector<float> optical_depth_;    // of one step, by node
  size_t last_view_ = 0;
};

}  // namespace

void FillHiddenSpace(FieldGrid& grid, float level, std::span<const Eigen::Vector3f> view_centers,
                     double max_optical_depth) {
  // Only nodes next to open space are tested for sight: the surface lies there, and tests are what takes the time.
  SightTester sight(grid, level, view_centers, static_cast<float>(max_optical_depth));
  enum State : uint8_t { kUntouched, kOpen, kClosed };
  std::vector<uint8_t> state(grid.raw.size(), kUntouched);
  const auto enter = [&](size_t index) {
    const float raw = grid.raw[index];
    if (state[index] != kUntouched || raw > level || raw == kBeyondBoxRaw) return false;
    const bool open = raw == kEmptyRaw || sight.IsSeen(grid.NodeAt(index));
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
