#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace romap::slam {

// Matrix of the cross product: Skew(a) * b = a x b.
inline Eigen::Matrix3d Skew(const Eigen::Vector3d& a) {
  Eigen::Matrix3d skew;
  skew << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return skew;
}

// Rotation about the axis `rotation_rad` by its length in radians (the exponential map of SO(3)).
inline Eigen::Matrix3d ExpRotationMatrix(const Eigen::Vector3d& rotation_rad) {
  const double angle_rad = rotation_rad.norm();
  if (angle_rad == 0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle_rad, rotation_rad / angle_rad).toRotationMatrix();
}

}  // namespace romap::slam
