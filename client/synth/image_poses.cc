#include "client/synth/image_poses.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/lens.h"

namespace romap::synth {

ImagePoses::ImagePoses(const SE3<World, Camera>& T_world_camera) : ImagePoses({}, {T_world_camera}) {}

ImagePoses::ImagePoses(const CameraModel& camera, std::vector<SE3<World, Camera>> T_world_camera_of_row)
    : camera_(camera), rows_(std::move(T_world_camera_of_row)) {
  for (const SE3<World, Camera>& row : rows_) {
    const SE3<Camera, World> inverse = row.Inverse();
    inverses_.push_back({inverse.RotationMatrix(), inverse.translation()});
  }
}

SE3<World, Camera> ImagePoses::Row(double v_px) const {
  if (!Rolling()) return rows_[0];
  const double row = std::clamp(v_px, 0.0, static_cast<double>(rows_.size() - 1));
  const size_t above = std::min(static_cast<size_t>(row), rows_.size() - 2);
  const double share = row - static_cast<double>(above);
  const SE3<World, Camera>& a = rows_[above];
  const SE3<World, Camera>& b = rows_[above + 1];
  return {a.rotation().slerp(share, b.rotation()), (1 - share) * a.translation() + share * b.translation()};
}

Eigen::Vector3d ImagePoses::CameraPointInRow(double v_px, const Eigen::Vector3d& p_world) const {
  const double row = std::clamp(v_px, 0.0, static_cast<double>(rows_.size() - 1));
  const size_t above = std::min(static_cast<size_t>(row), rows_.size() - 2);
  const double share = row - static_cast<double>(above);
  const Inverse& a = inverses_[above];
  const Inverse& b = inverses_[above + 1];
  return (1 - share) * (a.rotation * p_world + a.translation) + share * (b.rotation * p_world + b.translation);
}

Eigen::Vector3d ImagePoses::CameraPoint(const Eigen::Vector3d& p_world) const {
  if (!Rolling()) return inverses_[0].rotation * p_world + inverses_[0].translation;
  // The row depends on the pose, which depends on the row. The image moves by a fraction of a row per row, so this
  // fixed-point iteration converges.
  constexpr int kMaxIterations = 20;
  constexpr double kTolerance_px = 1e-3;
  constexpr double kNear_m = 1e-3;
  const auto last_row = static_cast<double>(rows_.size() - 1);
  double row = 0.5 * last_row;
  Eigen::Vector3d p_camera = CameraPointInRow(row, p_world);
  for (int iteration = 0; iteration < kMaxIterations && p_camera.z() > kNear_m; ++iteration) {
    const Eigen::Vector2d pixel_px = ProjectDistorted(camera_, p_camera);
    if (!std::isfinite(pixel_px.y())) break;
    const double next_row = std::clamp(pixel_px.y(), 0.0, last_row);
    if (std::abs(next_row - row) < kTolerance_px) break;
    row = next_row;
    p_camera = CameraPointInRow(row, p_world);
  }
  return p_camera;
}

}  // namespace romap::synth
