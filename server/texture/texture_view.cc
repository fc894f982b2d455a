#include "server/texture/texture_view.h"

#include <cmath>
#include <opencv2/core.hpp>

#include "common/status.h"

namespace romap::texture {

absl::Status ValidateTextureView(const TrainingCamera& view) {
  if (!view.T_camera_object.IsFinite()) return InvalidArgument("the pose is not finite");
  const CameraModel& camera = view.camera;
  if (!(camera.fx_px > 0 && camera.fy_px > 0) || !std::isfinite(camera.fx_px + camera.fy_px) ||
      !std::isfinite(camera.cx_px + camera.cy_px)) {
    return InvalidArgument(
        "the camera has focal lengths {} x {} px and principal point ({}, {}), must be finite, with "
        "focal lengths above 0",
        camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px);
  }
  if (camera.HasDistortion()) return InvalidArgument("the camera has distortion, must be a pinhole");
  if (view.roi_px.width < 1 || view.roi_px.height < 1) {
    return InvalidArgument("the crop is {} x {} px, must not be empty", view.roi_px.width, view.roi_px.height);
  }
  if (view.color_bgr.type() != CV_8UC3 || view.color_bgr.size() != view.roi_px.size()) {
    return InvalidArgument("color_bgr has type {} and {} x {} px, must be CV_8UC3 ({}) with the {} x {} px of the crop",
                           view.color_bgr.type(), view.color_bgr.cols, view.color_bgr.rows, CV_8UC3, view.roi_px.width,
                           view.roi_px.height);
  }
  if (view.ray_kind.type() != CV_8UC1 || view.ray_kind.size() != view.roi_px.size()) {
    return InvalidArgument("ray_kind has type {} and {} x {} px, must be CV_8UC1 ({}) with the {} x {} px of the crop",
                           view.ray_kind.type(), view.ray_kind.cols, view.ray_kind.rows, CV_8UC1, view.roi_px.width,
                           view.roi_px.height);
  }
  return absl::OkStatus();
}

std::vector<double> ResolutionsAt(std::span<const TrainingCamera> views, const Eigen::Vector3f& point) {
  std::vector<double> resolutions;
  for (const TrainingCamera& view : views) {
    const double depth_mu = (view.T_camera_object * point.cast<double>()).z();
    if (depth_mu > 0) resolutions.push_back((view.camera.fx_px + view.camera.fy_px) / 2 / depth_mu);
  }
  return resolutions;
}

}  // namespace romap::texture
