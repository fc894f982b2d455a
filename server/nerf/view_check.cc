#include "server/nerf/view_check.h"

#include <fmt/ostream.h>

#include <opencv2/core.hpp>
#include <string>

#include "common/status.h"

namespace romap::nerf {
namespace {

constexpr int kFewestObjectPixels = 16;

// Empty when `image` is what a crop of `size` needs, else what is wrong.
std::string ImageFault(const char* name, const cv::Mat& image, cv::Size size, int type, const char* type_name) {
  if (image.size() != size) {
    return fmt::format("{} is {}x{} px, the crop is {}x{} px", name, image.cols, image.rows, size.width, size.height);
  }
  if (image.type() != type) return fmt::format("{} must be {}", name, type_name);
  return {};
}

std::string ViewFault(const ObjectView& view, const TrainingBox& box) {
  if (!view.keyframe) return "it has no keyframe id";
  if (const absl::Status status = ValidateCameraModel(view.camera); !status.ok()) return Message(status);
  if (view.camera.HasDistortion()) return "its camera has distortion; undistort the image first";
  if (!view.T_world_camera.IsFinite()) return "its pose is not finite";
  const cv::Rect image(0, 0, view.camera.width_px, view.camera.height_px);
  if (view.roi_px.empty() || (view.roi_px & image) != view.roi_px) {
    return fmt::format("its crop (x {}, y {}, {}x{} px) does not lie in the image of {}x{} px", view.roi_px.x,
                       view.roi_px.y, view.roi_px.width, view.roi_px.height, image.width, image.height);
  }
  const cv::Size size = view.roi_px.size();
  if (std::string fault = ImageFault("color_bgr", view.color_bgr, size, CV_8UC3, "CV_8UC3"); !fault.empty()) {
    return fault;
  }
  if (std::string fault = ImageFault("ray_kind", view.ray_kind, size, CV_8UC1, "CV_8UC1"); !fault.empty()) {
    return fault;
  }
  if (!view.depth_mu.empty()) {
    std::string fault = ImageFault("depth_mu", view.depth_mu, size, CV_32FC1, "CV_32FC1");
    if (!fault.empty()) return fault;
  }
  const int object_pixels = cv::countNonZero(view.ray_kind == static_cast<int>(RayKind::kObject));
  if (object_pixels == 0) return "its mask is empty";
  if (object_pixels < kFewestObjectPixels) return fmt::format("its mask has only {} px", object_pixels);
  const Eigen::Vector3d center_camera = view.T_world_camera.Inverse() * box.T_world_object.translation();
  if (center_camera.z() <= 0) return "the object's box lies behind the camera";
  return {};
}

}  // namespace

absl::Status ValidateView(const ObjectView& view, const TrainingBox& box) {
  const std::string fault = ViewFault(view, box);
  if (fault.empty()) return absl::OkStatus();
  return InvalidArgument("view of {} in {}: {}", view.object.ToString(), view.keyframe.ToString(), fault);
}

}  // namespace romap::nerf
