#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <limits>

#include "common/camera_model.h"

namespace romap::slam {

// Distance in pixels from `second_px` to the nearest projection of a point on `first_ray` in front of the first camera,
// for the motion p_second = rotation * p_first + translation. These projections are a half-line from the projection of
// the point at infinity, or this projection alone if the camera only rotated. In contrast to the epipolar distance, it
// is defined for a pure rotation, and it depends on the direction of the translation. Infinite if the point at infinity
// is behind the second camera.
inline double DistanceToProjectionRay_px(const CameraModel& camera, const Eigen::Matrix3d& rotation,
                                         const Eigen::Vector3d& translation, const Eigen::Vector3d& first_ray,
                                         const Eigen::Vector2d& second_px) {
  const Eigen::Vector3d at_infinity = rotation * first_ray;
  if (!(at_infinity.z() > 0)) return std::numeric_limits<double>::infinity();
  const Eigen::Vector2d focal_px(camera.fx_px, camera.fy_px);
  const Eigen::Vector2d offset_px = second_px - camera.Project(at_infinity);
  const Eigen::Vector2d direction =
      focal_px.cwiseProduct(translation.head<2>() * at_infinity.z() - at_infinity.head<2>() * translation.z());
  const double length = direction.norm();
  if (!(length > 0)) return offset_px.norm();
  const double along_px = std::max(0.0, offset_px.dot(direction) / length);
  return (offset_px - direction * (along_px / length)).norm();
}

}  // namespace romap::slam
