#include "server/mesh/unseen_space.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace romap {
namespace {

// exp of less than this adds nothing over the few steps through a box.
constexpr float kTransparentRaw = -8.0f;
// Keeps exp finite; far above any level in use.
constexpr float kOpaqueRaw = 20.0f;

class SightTester {
 public:
  // Rays advance by the smallest node spacing, and the node nearest to each step speaks for it.
  SightTester(const FieldGrid& grid, float level, float max_optical_depth)
      : grid_(grid), step_mu_(grid.spacing.minCoeff()), max_optical_depth_(max_optical_depth) {
    const float step_per_side = step_mu_ / grid.longest_side_mu;
    optical_depth_.resize(grid.raw.size());
    for (size_t i = 0; i < grid.raw.size(); ++i) {
      const float raw = grid.raw[i];
      if (raw > level) {
        optical_depth_[i] = 2.0f * max_optical_depth;
      } else if (raw < kTransparentRaw) {
        optical_depth_[i] = 0.0f;
      } else {
        optical_depth_[i] = std::exp(std::min(raw, kOpaqueRaw)) * step_per_side;
      }
    }
  }

  // `node` and `view` in node coordinates.
  bool Sees(const Eigen::Vector3f& view, const Eigen::Vector3f& node) const {
    const Eigen::Vector3f way = view - node;
    const float way_mu = way.cwiseProduct(grid_.spacing).norm();
    if (!(way_mu > step_mu_)) return true;
    const Eigen::Vector3f step = way * (step_mu_ / way_mu);
    const int steps = StepsToLeaveBox(node, step, way_mu);
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

 private:
  // Whole steps from `node` that stay among the grid's nodes and do not pass the view.
  int StepsToLeaveBox(const Eigen::Vector3f& node, const Eigen::Vector3f& step, float way_mu) const {
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
  std::vector<float> optical_depth_;  // of one step, by node
};

std::vector<Eigen::Vector3f> InNodeCoordinates(const FieldGrid& grid, std::span<const Eigen::Vector3f> view_centers) {
  std::vector<Eigen::Vector3f> views;
  for (const Eigen::Vector3f& center : view_centers) {
    const Eigen::Vector3f view = (center - grid.origin).cwiseQuotient(grid.spacing);
    if (view.allFinite()) views.push_back(view);
  }
  return views;
}

}  // namespace

void FillUnseenSpace(FieldGrid& grid, float level, std::span<const Eigen::Vector3f> view_centers,
                     double max_optical_depth) {
  const std::vector<Eigen::Vector3f> views = InNodeCoordinates(grid, view_centers);
  if (views.empty()) return;
  const SightTester tester(grid, level, static_cast<float>(max_optical_depth));
  std::vector<size_t> unseen;
  size_t last_seen_by = 0;  // neighbours are mostly seen by the same view: ask it first
  const int last = grid.nodes_per_side - 2;
  for (int z = 1; z <= last; ++z) {
    for (int y = 1; y <= last; ++y) {
      for (int x = 1; x <= last; ++x) {
        const float raw = grid.raw[grid.Index(x, y, z)];
        if (raw > level || raw == kEmptyRaw) continue;
        const Eigen::Vector3f node(x, y, z);
        size_t tried = 0;
        while (tried < views.size() && !tester.Sees(views[(last_seen_by + tried) % views.size()], node)) ++tried;
        if (tried == views.size()) {
          unseen.push_back(grid.Index(x, y, z));
        } else {
          last_seen_by = (last_seen_by + tried) % views.size();
        }
      }
    }
  }
  for (const size_t node : unseen) grid.raw[node] = level + kSolidMargin;
}

}  // namespace romap
