#include "server/nerf/view_check.h"

#include <fmt/ostream.h>

#include <opencv2/core.hpp>
#include <string>

#include "common/status.h"

namespace romap::nerf {
namespace {

constexpr int kMinObjectPixels = 16;

// Empty if `image` has the size of the crop and the right type.
std::string ImageError(const char* name, const cv::Mat& image, cv::Size size, int type, const char* type_name) {
  if (image.size() != size) {
    return fmt::format("{} must be {}x{} px like the crop, is {}x{} px", name, size.width, size.height, image.cols,
                       image.rows);
  }
  if (image.type() != type) return fmt::format("{} must be {}", name, type_name);
  return {};
}

// Empty if the view is valid.
std::string ViewError(const ObjectView& view, const TrainingBox& box) {
  if (!view.keyframe) return "keyframe id is missing";
  if (const absl::Status status = ValidateCameraModel(view.camera); !status.ok()) return Message(status);
  if (view.camera.HasDistortion()) return "the camera has lens distortion; undistort the image first";
  if (!view.T_world_camera.IsFinite()) return "pose is not finite";
  const cv::Rect image(0, 0, view.camera.width_px, view.camera.height_px);
  if (view.roi_px.empty() || (view.roi_px & image) != view.roi_px) {
    return fmt::format("the crop (x {}, y {}, {}x{} px) must be inside the image of {}x{} px", view.roi_px.x,
                       view.roi_px.y, view.roi_px.width, view.roi_px.height, image.width, image.height);
  }
  const cv::Size size = view.roi_px.size();
  if (std::string error = ImageError("color_bgr", view.color_bgr, size, CV_8UC3, "CV_8UC3"); !error.empty()) {
    return error;
  }
  if (std::string error = ImageError("ray_kind", view.ray_kind, size, CV_8UC1, "CV_8UC1"); !error.empty()) {
    return error;
  }
  if (!view.depth_mu.empty()) {
    std::string error = ImageError("depth_mu", view.depth_mu, size, CV_32FC1, "CV_32FC1");
    if (!error.empty()) return error;
  }
  const int object_pixels = cv::countNonZero(view.ray_kind == static_cast<int>(RayKind::kObject));
  if (object_pixels == 0) return "mask is empty";
  if (object_pixels < kMinObjectPixels) {
    return fmt::format("mask must have at least {} object pixels, has {}", kMinObjectPixels, object_pixels);
  }
  const Eigen::Vector3d center_camera = view.T_world_camera.Inverse() * box.T_world_object.translation();
  if (center_camera.z() <= 0) return "the object's box is behind the camera";
  return {};
}

}  // namespace

absl::Status ValidateView(const ObjectView& view, const TrainingBox& box) {
  const std::string error = ViewError(view, box);
  if (error.empty()) return absl::OkStatus();
  return InvalidArgument("view of {} in {}: {}", view.object.ToString(), view.keyframe.ToString(), error);
}

}  // namespace romap::nerf
