#pragma once

#include <Eigen/Core>

#include "common/camera_model.h"

namespace romap::slam {

// Lens distortion that the client's calibration does not model. Many cameras with distortion are calibrated as pinhole
// cameras, which bends the whole map. Brown's first radial term models most of it: a point at m = (p - c) / f in a
// pinhole image is at m (1 + k1 |m|^2) in the actual image.
struct RadialCorrection {
  double k1 = 0;

  Eigen::Vector2d Distort(const CameraModel& camera, const Eigen::Vector2d& pinhole_px) const {
    const Eigen::Vector2d center_px(camera.cx_px, camera.cy_px);
    const Eigen::Vector2d offset_px = pinhole_px - center_px;
    return center_px + (1 + k1 * Radius2(camera, offset_px)) * offset_px;
  }

  // The inverse, by fixed-point iteration; accurate to 0.001 px for the small k1 of calibrated cameras.
  Eigen::Vector2d Undistort(const CameraModel& camera, const Eigen::Vector2d& observed_px) const {
    constexpr int kIterations = 6;
    const Eigen::Vector2d center_px(camera.cx_px, camera.cy_px);
    Eigen::Vector2d offset_px = observed_px - center_px;
    for (int i = 0; i < kIterations; ++i) offset_px = (observed_px - center_px) / (1 + k1 * Radius2(camera, offset_px));
    return center_px + offset_px;
  }

  bool operator==(const RadialCorrection&) const = default;

 private:
  static double Radius2(const CameraModel& camera, const Eigen::Vector2d& offset_px) {
    return Eigen::Vector2d(offset_px.x() / camera.fx_px, offset_px.y() / camera.fy_px).squaredNorm();
  }
};

}  // namespace romap::slam
