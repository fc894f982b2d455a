#include "client/doctor/camera_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/angles.h"

namespace romap::doctor {
namespace {

// Real lenses that are modelled as a pinhole with distortion.
constexpr double kMinView_deg = 10;
constexpr double kMaxView_deg = 140;
constexpr double kMaxPixelAspect = 1.2;   // of the focal lengths
constexpr double kMaxCenterOffset = 0.2;  // of the image's size: principal point from the middle of the image
constexpr double kMaxDistortion = 1.5;    // relative change of a corner's distance from the center

Diagnostic Implausible(std::string text, std::string advice) {
  return {.code = "calibration_implausible",
          .severity = Severity::kWarning,
          .text = std::move(text),
          .advice = std::move(advice)};
}

// Relative change of the distance of the image's corner from the center by the radial distortion.
double CornerDistortion(const CameraModel& camera) {
  const double x = std::max(camera.cx_px, camera.width_px - camera.cx_px) / camera.fx_px;
  const double y = std::max(camera.cy_px, camera.height_px - camera.cy_px) / camera.fy_px;
  const double r2 = x * x + y * y;
  return camera.distortion[0] * r2 + camera.distortion[1] * r2 * r2 + camera.distortion[4] * r2 * r2 * r2;
}

}  // namespace

std::vector<Diagnostic> CheckCamera(const CameraModel& camera) {
  std::vector<Diagnostic> found;
  const double view_deg = 2 * std::atan2(camera.width_px / 2.0, camera.fx_px) * kDegPerRad;
  const bool is_fisheye = camera.lens == LensModel::kFisheye;
  if (view_deg < kMinView_deg || (!is_fisheye && view_deg > kMaxView_deg)) {
    found.push_back(
        Implausible(fmt::format("the horizontal field of view is {:.0f} deg (fx {:.1f} px at a width of {} px)",
                                view_deg, camera.fx_px, camera.width_px),
                    "check fx and the size; both must be of the same resolution"));
  }
  const double aspect = std::max(camera.fx_px / camera.fy_px, camera.fy_px / camera.fx_px);
  if (aspect > kMaxPixelAspect) {
    found.push_back(
        Implausible(fmt::format("fx is {:.1f} px and fy is {:.1f} px; the pixels of nearly all cameras are square",
                                camera.fx_px, camera.fy_px),
                    "check that width and height are not swapped"));
  }
  const double dx = std::abs(camera.cx_px - (camera.width_px - 1) / 2.0) / camera.width_px;
  const double dy = std::abs(camera.cy_px - (camera.height_px - 1) / 2.0) / camera.height_px;
  if (std::max(dx, dy) > kMaxCenterOffset) {
    found.push_back(
        Implausible(fmt::format("the principal point ({:.1f}, {:.1f}) px is far from the middle of the {}x{} px image",
                                camera.cx_px, camera.cy_px, camera.width_px, camera.height_px),
                    "check cx and cy; they must be of the same resolution as the size"));
  }
  if (!is_fisheye && std::abs(CornerDistortion(camera)) > kMaxDistortion) {
    found.push_back(Implausible(
        fmt::format("the distortion moves the corners of the image by {:.0f} % of their distance from the center",
                    100 * CornerDistortion(camera)),
        "check the order k1 k2 p1 p2 k3, and whether the lens is a fisheye"));
  }
  if (found.size() > 1) {  // one diagnostic per code
    for (size_t k = 1; k < found.size(); ++k) found[0].text += "; " + found[k].text;
    found.resize(1);
  }
  return found;
}

}  // namespace romap::doctor
