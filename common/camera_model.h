#pragma once

#include <absl/status/status.h>

#include <Eigen/Core>
#include <array>

namespace romap {

// Distortion model of a lens.
enum class LensModel {
  kRadialTangential,  // OpenCV's k1 k2 p1 p2 k3; a pinhole if all are 0
  kFisheye,           // equidistant with OpenCV's fisheye coefficients k1 k2 k3 k4 (Kannala and Brandt, PAMI 2006)
};

// Pinhole camera with lens distortion (common/lens.h). Pixel centers are at integer coordinates.
struct CameraModel {
  int width_px = 0;
  int height_px = 0;
  double fx_px = 0;
  double fy_px = 0;
  double cx_px = 0;
  double cy_px = 0;
  std::array<double, 5> distortion{};  // coefficients of `lens`; the fifth of a fisheye is 0
  LensModel lens = LensModel::kRadialTangential;
  // Rolling shutter: the time from the first to the last row of the image, 0..1 s; 0 for a global shutter. The pose of
  // a frame is that of its middle row.
  double readout_s = 0;

  // Pinhole projection of a point in the camera frame (z > 0) to pixels, without distortion.
  Eigen::Vector2d Project(const Eigen::Vector3d& p_camera) const {
    return {fx_px * p_camera.x() / p_camera.z() + cx_px, fy_px * p_camera.y() / p_camera.z() + cy_px};
  }
  // Direction with z = 1 through a pixel, without distortion; not normalized.
  Eigen::Vector3d Unproject(double u_px, double v_px) const {
    return {(u_px - cx_px) / fx_px, (v_px - cy_px) / fy_px, 1.0};
  }
  // False for a pinhole. A fisheye has distortion even if its coefficients are all 0.
  bool HasDistortion() const {
    if (lens == LensModel::kFisheye) return true;
    for (double k : distortion) {
      if (k != 0) return true;
    }
    return false;
  }
  // The same camera without distortion. The rows of the pinhole image are read at about the same times.
  CameraModel Pinhole() const {
    CameraModel pinhole = *this;
    pinhole.lens = LensModel::kRadialTangential;
    pinhole.distortion = {};
    return pinhole;
  }
  bool operator==(const CameraModel&) const = default;
};

// Number of distortion coefficients of a lens.
inline int CoefficientCount(LensModel lens) { return lens == LensModel::kFisheye ? 4 : 5; }

// INVALID_ARGUMENT, with the first invalid field and its range in the message: size outside 16..8192 px, focal length
// outside 0.01..1000 sides of the image, principal point more than one image size outside the image, distortion outside
// -1e6..1e6, or more coefficients than the lens has; readout time outside 0..1 s.
absl::Status ValidateCameraModel(const CameraModel& camera);

}  // namespace romap
