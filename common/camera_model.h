#pragma once

#include <absl/status/status.h>

#include <Eigen/Core>
#include <array>

namespace romap {

// Pinhole camera with radial-tangential distortion (OpenCV's k1 k2 p1 p2 k3). Pixel centres lie at integer coordinates.
struct CameraModel {
  int width_px = 0;
  int height_px = 0;
  double fx_px = 0;
  double fy_px = 0;
  double cx_px = 0;
  double cy_px = 0;
  std::array<double, 5> distortion{};  // k1 k2 p1 p2 k3

  // Pinhole projection of a point in the camera frame (z > 0) to pixels, without distortion.
  Eigen::Vector2d Project(const Eigen::Vector3d& p_camera) const {
    return {fx_px * p_camera.x() / p_camera.z() + cx_px, fy_px * p_camera.y() / p_camera.z() + cy_px};
  }
  // Direction with z = 1 through a pixel, without distortion; not normalised.
  Eigen::Vector3d Unproject(double u_px, double v_px) const {
    return {(u_px - cx_px) / fx_px, (v_px - cy_px) / fy_px, 1.0};
  }
  bool HasDistortion() const {
    for (double k : distortion) {
      if (k != 0) return true;
    }
    return false;
  }
  bool operator==(const CameraModel&) const = default;
};

// INVALID_ARGUMENT naming the first field that cannot be (size outside 16..8192 px, focal length not positive or not
// finite, principal point outside the image by more than its size, distortion not finite).
absl::Status ValidateCameraModel(const CameraModel& camera);

}  // namespace romap
