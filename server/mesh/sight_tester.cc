#include "server/mesh/sight_tester.h"

#include <algorithm>
#include <cmath>

namespace romap::mesh {
namespace {

// e^-12 of the surface's density adds nothing over the few steps through a box.
constexpr float kTransparent = -12.0f;
// Places are shifted by half a node, so that truncation rounds to the nearest node.
constexpr float kToNearest = 0.5f;
// Longer than any way through a grid.
constexpr float kMostSteps = 1e6f;

}  // namespace

SightTester::SightTester(const FieldGrid& grid, const SightLimits& limits)
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
  const float depth_at_surface = limits.surface_density_per_mu * step_mu_;
  seen_.assign(grid.value.size(), 0);
  optical_depth_.assign(grid.value.size(), 0.0f);
  for (size_t i = 0; i < grid.value.size(); ++i) {
    const float value = grid.value[i];
    if (value > 0) {
      optical_depth_[i] = 2.0f * max_optical_depth_;
    } else if (value > kTransparent) {
      optical_depth_[i] = std::exp(value) * depth_at_surface;
    }
  }
}

bool SightTester::IsSeen(size_t node) {
  if (views_.empty()) return false;
  if (seen_[node] != 0) return true;
  const Eigen::Vector3f place(static_cast<float>(node % stride_y_), static_cast<float>(node % stride_z_ / stride_y_),
                              static_cast<float>(node / stride_z_));
  // Neighbours are mostly seen by the same view, so the last one to see anything goes first.
  for (size_t tried = 0; tried < views_.size(); ++tried) {
    const size_t view = (last_view_ + tried) % views_.size();
    if (!IsWayClear(views_[view], place)) continue;
    seen_[node] = 1;
    for (size_t i = 0; i < way_length_; ++i) seen_[way_[i]] = 1;
    last_view_ = view;
    return true;
  }
  return false;
}

bool SightTester::IsSurfaceSeen(const Eigen::Vector3f& place, const Eigen::Vector3f& normal, float min_cosine) {
  for (size_t tried = 0; tried < views_.size(); ++tried) {
    const size_t view = (last_view_ + tried) % views_.size();
    const Eigen::Vector3f way_mu = (views_[view] - place).cwiseProduct(spacing_);
    if (normal.dot(way_mu) >= min_cosine * way_mu.norm() && IsWayClear(views_[view], place)) {
      last_view_ = view;
      return true;
    }
  }
  return false;
}

bool SightTester::IsWayClear(const Eigen::Vector3f& view, const Eigen::Vector3f& place) {
  way_length_ = 0;
  const Eigen::Vector3f way = view - place;
  const float way_mu = way.cwiseProduct(spacing_).norm();
  if (!(way_mu > step_mu_)) return true;
  const Eigen::Vector3f step = way * (step_mu_ / way_mu);
  Eigen::Vector3f at = place + Eigen::Vector3f::Constant(kToNearest);
  const int steps = StepsWithinGrid(place, step, way_mu);
  if (way_.size() < static_cast<size_t>(steps)) way_.resize(static_cast<size_t>(steps));
  float depth = 0;
  for (int i = 0; i < steps; ++i) {
    at += step;
    const size_t node = NodeNear(at);
    depth += optical_depth_[node];
    if (depth > max_optical_depth_) return false;
    way_[static_cast<size_t>(i)] = static_cast<uint32_t>(node);
  }
  way_length_ = static_cast<size_t>(steps);
  return true;
}

int SightTester::StepsWithinGrid(const Eigen::Vector3f& place, const Eigen::Vector3f& step, float way_mu) const {
  float steps = way_mu / step_mu_;
  for (int axis = 0; axis < 3; ++axis) {
    if (step[axis] == 0) continue;
    const float end = step[axis] > 0 ? static_cast<float>(nodes_[axis] - 1) : 0.0f;
    steps = std::min(steps, (end - place[axis]) / step[axis]);
  }
  // A view so far away that the way to it has no direction in floats is no way off.
  return steps > 0 && steps < kMostSteps ? static_cast<int>(steps) : 0;
}

size_t SightTester::NodeNear(const Eigen::Vector3f& shifted) const {
  return static_cast<size_t>(static_cast<int>(shifted.z())) * stride_z_ +
         static_cast<size_t>(static_cast<int>(shifted.y())) * stride_y_ +
         static_cast<size_t>(static_cast<int>(shifted.x()));
}

}  // namespace romap::mesh
