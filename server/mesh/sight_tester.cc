#include "server/mesh/sight_tester.h"

#include <algorithm>
#include <cmath>

namespace romap {
namespace {

// e^-12 of the surface's density adds nothing over the few steps through a box.
constexpr float kTransparent = -12.0f;
// Places are shifted by half a node, so that truncation rounds to the nearest node.
constexpr float kToNearest = 0.5f;

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
    if (const std::optional<Way> way = ClearWay(views_[view], place)) {
      MarkSeen(place, *way);
      last_view_ = view;
      return true;
    }
  }
  return false;
}

bool SightTester::IsSurfaceSeen(const Eigen::Vector3f& place, const Eigen::Vector3f& normal, float min_cosine) {
  for (size_t tried = 0; tried < views_.size(); ++tried) {
    const size_t view = (last_view_ + tried) % views_.size();
    const Eigen::Vector3f way_mu = (views_[view] - place).cwiseProduct(spacing_);
    if (normal.dot(way_mu) >= min_cosine * way_mu.norm() && ClearWay(views_[view], place)) {
      last_view_ = view;
      return true;
    }
  }
  return false;
}

std::optional<SightTester::Way> SightTester::ClearWay(const Eigen::Vector3f& view, const Eigen::Vector3f& place) const {
  const Eigen::Vector3f way = view - place;
  const float way_mu = way.cwiseProduct(spacing_).norm();
  if (!(way_mu > step_mu_)) return Way{};
  const Eigen::Vector3f step = way * (step_mu_ / way_mu);
  Eigen::Vector3f at = place + Eigen::Vector3f::Constant(kToNearest);
  const int steps = StepsWithinGrid(place, step, way_mu);
  float depth = 0;
  for (int i = 0; i < steps; ++i) {
    at += step;
    depth += optical_depth_[NodeNear(at)];
    if (depth > max_optical_depth_) return std::nullopt;
  }
  return Way{step, steps};
}

int SightTester::StepsWithinGrid(const Eigen::Vector3f& place, const Eigen::Vector3f& step, float way_mu) const {
  float steps = way_mu / step_mu_;
  for (int axis = 0; axis < 3; ++axis) {
    if (step[axis] == 0) continue;
    const float end = step[axis] > 0 ? static_cast<float>(nodes_[axis] - 1) : 0.0f;
    steps = std::min(steps, (end - place[axis]) / step[axis]);
  }
  return static_cast<int>(std::max(steps, 0.0f));
}

size_t SightTester::NodeNear(const Eigen::Vector3f& shifted) const {
  return static_cast<size_t>(static_cast<int>(shifted.z())) * stride_z_ +
         static_cast<size_t>(static_cast<int>(shifted.y())) * stride_y_ +
         static_cast<size_t>(static_cast<int>(shifted.x()));
}

void SightTester::MarkSeen(const Eigen::Vector3f& place, const Way& way) {
  Eigen::Vector3f at = place + Eigen::Vector3f::Constant(kToNearest);
  seen_[NodeNear(at)] = 1;
  for (int i = 0; i < way.steps; ++i) {
    at += way.step;
    seen_[NodeNear(at)] = 1;
  }
}

}  // namespace romap
