#include "server/mesh/visibility.h"

#include <algorithm>
#include <cmath>

namespace romap::mesh {
namespace {

// e^-12 of the surface's density is negligible over the few steps through a box.
constexpr float kTransparent = -12.0f;
// Points are shifted by half a node, so that truncation rounds to the nearest node.
constexpr float kToNearest = 0.5f;
// More steps than any line through a grid has.
constexpr float kMaxSteps = 1e6f;

}  // namespace

std::vector<float> NodeOpticalDepths(const FieldGrid& grid, float surface_density_per_mu, float max_optical_depth) {
  const float depth_at_surface = surface_density_per_mu * grid.spacing.minCoeff();
  std::vector<float> optical_depth(grid.value.size(), 0.0f);
  for (size_t i = 0; i < grid.value.size(); ++i) {
    const float value = grid.value[i];
    if (value > 0) {
      optical_depth[i] = 2.0f * max_optical_depth;
    } else if (value > kTransparent) {
      optical_depth[i] = std::exp(value) * depth_at_surface;
    }
  }
  return optical_depth;
}

VisibilityTester::VisibilityTester(const FieldGrid& grid, const VisibilityLimits& limits)
    : nodes_(grid.nodes),
      stride_y_(grid.StrideY()),
      stride_z_(grid.StrideZ()),
      spacing_(grid.spacing),
      step_mu_(grid.spacing.minCoeff()),
      max_optical_depth_(limits.max_optical_depth) {
  for (const Eigen::Vector3f& center : limits.view_centers) {
    const Eigen::Vector3f view = grid.ToNode(center);
    if (view.allFinite()) views_.push_back(view);
  }
  if (views_.empty()) return;
  visible_.assign(grid.value.size(), 0);
  optical_depth_ = NodeOpticalDepths(grid, limits.surface_density_per_mu, max_optical_depth_);
}

bool VisibilityTester::IsVisible(size_t node) {
  if (views_.empty()) return false;
  if (visible_[node] != 0) return true;
  const Eigen::Vector3f point(static_cast<float>(node % stride_y_), static_cast<float>(node % stride_z_ / stride_y_),
                              static_cast<float>(node / stride_z_));
  // Neighboring nodes are mostly visible from the same view, so the last successful view is tried first.
  for (size_t tried = 0; tried < views_.size(); ++tried) {
    const size_t view = (last_view_ + tried) % views_.size();
    if (!IsPathClear(views_[view], point)) continue;
    visible_[node] = 1;
    for (size_t i = 0; i < path_length_; ++i) visible_[path_[i]] = 1;
    last_view_ = view;
    return true;
  }
  return false;
}

bool VisibilityTester::IsSurfaceVisible(const Eigen::Vector3f& point, const Eigen::Vector3f& normal, float min_cosine) {
  for (size_t tried = 0; tried < views_.size(); ++tried) {
    const size_t view = (last_view_ + tried) % views_.size();
    const Eigen::Vector3f to_view_mu = (views_[view] - point).cwiseProduct(spacing_);
    if (normal.dot(to_view_mu) >= min_cosine * to_view_mu.norm() && IsPathClear(views_[view], point)) {
      last_view_ = view;
      return true;
    }
  }
  return false;
}

bool VisibilityTester::IsPathClear(const Eigen::Vector3f& view, const Eigen::Vector3f& point) {
  path_length_ = 0;
  const Eigen::Vector3f to_view = view - point;
  const float distance_mu = to_view.cwiseProduct(spacing_).norm();
  if (!(distance_mu > step_mu_)) return true;
  const Eigen::Vector3f step = to_view * (step_mu_ / distance_mu);
  Eigen::Vector3f at = point + Eigen::Vector3f::Constant(kToNearest);
  const int steps = StepsWithinGrid(point, step, distance_mu);
  if (path_.size() < static_cast<size_t>(steps)) path_.resize(static_cast<size_t>(steps));
  float depth = 0;
  for (int i = 0; i < steps; ++i) {
    at += step;
    const size_t node = NearestNode(at);
    depth += optical_depth_[node];
    if (depth > max_optical_depth_) return false;
    path_[static_cast<size_t>(i)] = static_cast<uint32_t>(node);
  }
  path_length_ = static_cast<size_t>(steps);
  return true;
}

int VisibilityTester::StepsWithinGrid(const Eigen::Vector3f& point, const Eigen::Vector3f& step,
                                      float distance_mu) const {
  float steps = distance_mu / step_mu_;
  for (int axis = 0; axis < 3; ++axis) {
    if (step[axis] == 0) continue;
    const float end = step[axis] > 0 ? static_cast<float>(nodes_[axis] - 1) : 0.0f;
    steps = std::min(steps, (end - point[axis]) / step[axis]);
  }
  // 0 for a view that is so far away that the step underflows.
  return steps > 0 && steps < kMaxSteps ? static_cast<int>(steps) : 0;
}

size_t VisibilityTester::NearestNode(const Eigen::Vector3f& shifted) const {
  return static_cast<size_t>(static_cast<int>(shifted.z())) * stride_z_ +
         static_cast<size_t>(static_cast<int>(shifted.y())) * stride_y_ +
         static_cast<size_t>(static_cast<int>(shifted.x()));
}

}  // namespace romap::mesh
