#pragma once

// Cameras, points and noise for the tests of the solvers, the same on every machine.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include "common/angles.h"
#include "common/camera_model.h"
#include "common/geometry.h"

namespace romap::slam {

inline CameraModel TestCamera() {
  return {.width_px = 640, .height_px = 480, .fx_px = 525, .fy_px = 530, .cx_px = 319.5, .cy_px = 239.5};
}

// The standard library's distributions differ between implementations; these do not.
class Noise {
 public:
  explicit Noise(uint64_t seed) : random_(seed) {}

  // In [low, high).
  double Uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(random_() >> 11) * 0x1.0p-53;
  }
  // Normal with mean 0 (Box and Muller).
  double Normal(double sigma) {
    return sigma * std::sqrt(-2 * std::log(1 - Uniform(0, 1))) * std::cos(2 * std::numbers::pi * Uniform(0, 1));
  }
  Eigen::Vector2d Normal2(double sigma) {
    const double x = Normal(sigma);
    return {x, Normal(sigma)};
  }
  Eigen::Vector3d Normal3(double sigma) {
    const double x = Normal(sigma);
    const double y = Normal(sigma);
    return {x, y, Normal(sigma)};
  }
  Eigen::Vector2d Pixel(const CameraModel& camera) {
    const double u_px = Uniform(0, camera.width_px);
    return {u_px, Uniform(0, camera.height_px)};
  }

 private:
  std::mt19937_64 random_;
};

// Rotations about the x, y and z axes, multiplied in this order.
inline Eigen::Quaterniond RotationXyz(double x_deg, double y_deg, double z_deg) {
  return Eigen::AngleAxisd(x_deg * kRadPerDeg, Eigen::Vector3d::UnitX()) *
         Eigen::AngleAxisd(y_deg * kRadPerDeg, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(z_deg * kRadPerDeg, Eigen::Vector3d::UnitZ());
}

inline bool IsInImage(const CameraModel& camera, const Eigen::Vector3d& p_camera) {
  if (p_camera.z() <= 0) return false;
  const Eigen::Vector2d pixel_px = camera.Project(p_camera);
  return pixel_px.x() >= 0 && pixel_px.y() >= 0 && pixel_px.x() < camera.width_px && pixel_px.y() < camera.height_px;
}

inline double AngleBetween_deg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) / kRadPerDeg;
}
inline double AngleBetween_deg(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return a.angularDistance(b) / kRadPerDeg;
}

}  // namespace romap::slam
