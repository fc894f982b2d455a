#pragma once

#include <absl/status/status.h>

#include <opencv2/core/mat.hpp>

#include "common/camera_model.h"
#include "common/geometry.h"

namespace romap::texture {

// A photo of an object, from which its texture is taken. A crop of an image; pixels outside it are unknown.
struct TextureView {
  SE3<Camera, Object> T_camera_object;  // map units
  CameraModel camera;                   // of the full image, without distortion
  cv::Rect roi_px;                      // the crop in the full image
  cv::Mat color_bgr;                    // CV_8UC3, size of roi_px
  cv::Mat ray_kind;                     // CV_8UC1 of RayKind, size of roi_px
};

// INVALID_ARGUMENT, with the fault in the message: a pose or camera that is not finite, a lens with distortion, an
// empty crop, or images of another type or size.
absl::Status ValidateTextureView(const TextureView& view);

}  // namespace romap::texture
