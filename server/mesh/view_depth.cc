#include "server/mesh/view_depth.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "server/mesh/view_pixels.h"

namespace romap::mesh {
namespace {

constexpr float kUnknownDistance = std::numeric_limits<float>::quiet_NaN();
constexpr float kNoSurface = std::numeric_limits<float>::infinity();
constexpr float kMinDepth_mu = 1e-6f;
constexpr float kMaxDistance_nodes = 1e5f;  // beyond, single precision cannot tell nodes apart
constexpr int kMaxSide = 512;               // of the depth image, for a camera inside the box

}  // namespace

ViewDepth::ViewDepth(const FieldGrid& grid, const std::vector<float>& optical_depth, float max_optical_depth,
                     const TrainingCamera& view)
    : R_camera_object_(view.T_camera_object.rotation().toRotationMatrix().cast<float>()),
      t_camera_object_(view.T_camera_object.translation().cast<float>()),
      center_object_(view.T_camera_object.Inverse().translation().cast<float>()),
      focal_px_(static_cast<float>(view.camera.fx_px), static_cast<float>(view.camera.fy_px)),
      center_px_(static_cast<float>(view.camera.cx_px), static_cast<float>(view.camera.cy_px)),
      low_px_(static_cast<float>(view.roi_px.x), static_cast<float>(view.roi_px.y)) {
  if (!R_camera_object_.allFinite() || !focal_px_.allFinite()) return;
  if (!(grid.ToNode(center_object_).cwiseAbs().maxCoeff() < kMaxDistance_nodes)) return;
  const float node_px = grid.spacing.minCoeff() * focal_px_.mean() / std::max(t_camera_object_.norm(), kMinDepth_mu);
  const int longest_px = std::max(view.roi_px.width, view.roi_px.height);
  stride_px_ = std::max({1.0f, node_px, static_cast<float>(longest_px) / kMaxSide});
  size_ = {static_cast<int>(std::ceil(static_cast<float>(view.roi_px.width) / stride_px_)),
           static_cast<int>(std::ceil(static_cast<float>(view.roi_px.height) / stride_px_))};
  if (size_.minCoeff() <= 0) return;
  distance_mu_.assign(static_cast<size_t>(size_.prod()), kUnknownDistance);
  for (int y = 0; y < size_.y(); ++y) {
    for (int x = 0; x < size_.x(); ++x) {
      const Eigen::Vector2f pixel = PixelAt(x, y);
      const std::optional<RayKind> kind = KindAt(view, pixel.x(), pixel.y());
      if (!kind || *kind == RayKind::kOccluder) continue;
      distance_mu_[static_cast<size_t>(y * size_.x() + x)] =
          March(grid, optical_depth, max_optical_depth, DirectionAt(x, y));
    }
  }
}

// The distance at which the ray hits the surface.
float ViewDepth::March(const FieldGrid& grid, const std::vector<float>& optical_depth, float max_optical_depth,
                       const Eigen::Vector3f& direction_object) const {
  const float step_mu = grid.spacing.minCoeff();
  const Eigen::Vector3f start = grid.ToNode(center_object_);
  const Eigen::Vector3f per_mu = direction_object.cwiseQuotient(grid.spacing);
  const Eigen::Vector3f last = grid.nodes.cast<float>().array() - 2.0f;
  float enter = 0, leave = std::numeric_limits<float>::max();
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(per_mu[axis]) < 1e-12f) {
      if (start[axis] < 1 || start[axis] > last[axis]) return kNoSurface;
      continue;
    }
    const float a = (1.0f - start[axis]) / per_mu[axis], b = (last[axis] - start[axis]) / per_mu[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  float depth = 0;
  for (float distance = enter; distance <= leave; distance += step_mu) {
    const Eigen::Vector3f node = start + distance * per_mu + Eigen::Vector3f::Constant(0.5f);
    depth +=
        optical_depth[grid.Index(static_cast<int>(node.x()), static_cast<int>(node.y()), static_cast<int>(node.z()))];
    if (depth > max_optical_depth) return distance;
  }
  return kNoSurface;
}

Eigen::Vector2f ViewDepth::PixelAt(int x, int y) const {
  return low_px_ + stride_px_ * Eigen::Vector2f(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f) -
         Eigen::Vector2f::Constant(0.5f);
}

Eigen::Vector3f ViewDepth::DirectionAt(int x, int y) const {
  const Eigen::Vector2f ray = (PixelAt(x, y) - center_px_).cwiseQuotient(focal_px_);
  return R_camera_object_.transpose() * Eigen::Vector3f(ray.x(), ray.y(), 1.0f).normalized();
}

ViewDepth::Relation ViewDepth::Relate(const Eigen::Vector3f& p_object) const {
  if (distance_mu_.empty()) return Relation::kUnknown;
  const Eigen::Vector3f p_camera = R_camera_object_ * p_object + t_camera_object_;
  if (!(p_camera.z() > kMinDepth_mu)) return Relation::kUnknown;
  const Eigen::Vector2f pixel = focal_px_.cwiseProduct(p_camera.head<2>() / p_camera.z()) + center_px_;
  const Eigen::Vector2f at = (pixel - low_px_ + Eigen::Vector2f::Constant(0.5f)) / stride_px_;
  if (!(at.minCoeff() >= 0) || !(at.x() < static_cast<float>(size_.x())) || !(at.y() < static_cast<float>(size_.y()))) {
    return Relation::kUnknown;
  }
  const float surface_mu =
      distance_mu_[static_cast<size_t>(static_cast<int>(at.y()) * size_.x() + static_cast<int>(at.x()))];
  if (std::isnan(surface_mu)) return Relation::kUnknown;
  return p_camera.norm() < surface_mu ? Relation::kInFront : Relation::kBehind;
}

}  // namespace romap::mesh
