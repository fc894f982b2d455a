#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace romap {

inline constexpr double kRadPerDeg = std::numbers::pi / 180;
inline constexpr double kDegPerRad = 180 / std::numbers::pi;

// Angle between two vectors of any length, 0..pi; exact for small angles too.
inline double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace romap
