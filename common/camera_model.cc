#include "common/camera_model.h"

#include <algorithm>
#include <cmath>

#include "common/status.h"

namespace romap {
namespace {

// In units of the longer side of the image. A fisheye of 220 degrees has about 0.2, a telescope 100.
constexpr double kMinFocal = 0.01;
constexpr double kMaxFocal = 1000;
// The coefficients of a narrow lens are large, because they apply to powers of a small angle.
constexpr double kMaxDistortion = 1e6;

}  // namespace

absl::Status ValidateCameraModel(const CameraModel& camera) {
  const auto bad_size = [](int n) { return n < 16 || n > 8192; };
  if (bad_size(camera.width_px) || bad_size(camera.height_px)) {
    return InvalidArgument("camera: size must be in 16..8192 px, is {}x{} px", camera.width_px, camera.height_px);
  }
  const double side_px = std::max(camera.width_px, camera.height_px);
  const double min_focal_px = kMinFocal * side_px, max_focal_px = kMaxFocal * side_px;
  const auto bad_focal = [&](double f) { return !(f >= min_focal_px && f <= max_focal_px); };  // NaN is bad
  if (bad_focal(camera.fx_px) || bad_focal(camera.fy_px)) {
    return InvalidArgument(
        "camera: focal lengths must be in {:.3g}..{:.3g} px for images of {}x{} px, are fx={} fy={} px", min_focal_px,
        max_focal_px, camera.width_px, camera.height_px, camera.fx_px, camera.fy_px);
  }
  const auto bad_center = [](double c, int size) { return !std::isfinite(c) || c < -size || c > 2.0 * size; };
  if (bad_center(camera.cx_px, camera.width_px) || bad_center(camera.cy_px, camera.height_px)) {
    return InvalidArgument(
        "camera: principal point must be at most one image size outside the {}x{} px image, is cx={} cy={} px",
        camera.width_px, camera.height_px, camera.cx_px, camera.cy_px);
  }
  const bool fisheye = camera.lens == LensModel::kFisheye;
  const char* names = fisheye ? "k1 k2 k3 k4" : "k1 k2 p1 p2 k3";
  for (double k : camera.distortion) {
    if (!(std::abs(k) <= kMaxDistortion)) {  // NaN fails the comparison
      return InvalidArgument("camera: distortion ({}) must be in {:.0e}..{:.0e}, has {}", names, -kMaxDistortion,
                             kMaxDistortion, k);
    }
  }
  if (fisheye && camera.distortion[4] != 0) {
    return InvalidArgument("camera: a fisheye lens must have 4 distortion coefficients ({}), has 5", names);
  }
  if (!(camera.readout_s >= 0 && camera.readout_s <= 1)) {  // NaN fails the comparisons
    return InvalidArgument("camera: readout time must be in 0..1 s, is {} s", camera.readout_s);
  }
  return absl::OkStatus();
}

}  // namespace romap
