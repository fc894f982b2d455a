#include "server/mesh/sight_tester.h"

#include <algorithm>
#include <cmath>

namespace romap {
namespace {

// exp of less than this adds nothing over the few steps through a box.
constexpr float kTransparentRaw = -8.0f;
// Keeps exp finite; far above any level in use.
constexpr float kOpaqueRaw = 20.0f;

}  // namespace

SightTester::SightTester(const FieldGrid& grid, float level, std::span<const Eigen::Vector3f> view_centers,
                         float max_optical_depth)
    : nodes_per_side_(grid.nodes_per_side),
      stride_y_(grid.StrideY()),
      stride_z_(grid.StrideZ()),
      spacing_(grid.spacing),
      step_mu_(grid.spacing.minCoeff()),
      max_optical_depth_(max_optical_depth) {
  for (const Eigen::Vector3f& center : view_centers) {
    const Eigen::Vector3f view = grid.ToNode(center);
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

bool SightTester::IsSeen(const Eigen::Vector3f& place) {
  // Neighbours are mostly seen by the same view, so the last one to see anything goes first.
  for (size_t tried = 0; tried < views_.size(); ++tried) {
    const size_t view = (last_view_ + tried) % views_.size();
    if (Sees(views_[view], place)) {
      last_view_ = view;
      return true;
    }
  }
  return false;
}

bool SightTester::IsSurfaceSeen(const Eigen::Vector3f& place, const Eigen::Vector3f& normal, float min_cosine) {
  for (size_t tried = 0; tried < views_.size(); ++tried) {
    const size_t view = (last_view_ + tried) % views_.size();
    const Eigen::Vector3f way = (views_[view] - place).cwiseProduct(spacing_);
    if (normal.dot(way) >= min_cosine * way.norm() && Sees(views_[view], place)) {
      last_view_ = view;
      return true;
    }
  }
  return false;
}

bool SightTester::Sees(const Eigen::Vector3f& view, const Eigen::Vector3f& place) const {
  const Eigen::Vector3f way = view - place;
  const float way_mu = way.cwiseProduct(spacing_).norm();
  if (!(way_mu > step_mu_)) return true;
  const Eigen::Vector3f step = way * (step_mu_ / way_mu);
  const int steps = StepsWithinGrid(place, step, way_mu);
  Eigen::Vector3f at = place + Eigen::Vector3f::Constant(0.5f);  // so that truncation rounds to the nearest node
  float depth = 0;
  for (int i = 0; i < steps; ++i) {
    at += step;
    depth += optical_depth_[static_cast<size_t>(at.z()) * stride_z_ + static_cast<size_t>(at.y()) * stride_y_ +
                            static_cast<size_t>(at.x())];
    if (depth > max_optical_depth_) return false;
  }
  return true;
}

// Whole steps that stay among the grid's nodes and do not pass the view.
int SightTester::StepsWithinGrid(const Eigen::Vector3f& place, const Eigen::Vector3f& step, float way_mu) const {
  float steps = way_mu / step_mu_;
  const auto last = static_cast<float>(nodes_per_side_ - 1);
  for (int axis = 0; axis < 3; ++axis) {
    if (step[axis] == 0) continue;
    steps = std::min(steps, ((step[axis] > 0 ? last : 0.0f) - place[axis]) / step[axis]);
  }
  return static_cast<int>(std::max(steps, 0.0f));
}

}  // namespace romap
