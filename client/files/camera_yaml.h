#pragma once

#include <string>

#include "common/camera_model.h"
#include "common/status.h"

namespace romap::files {

// What a sequence says about its camera.
struct CameraYaml {
  CameraModel camera;
  double fps = 30;         // nominal frames per second
  double depth_scale = 0;  // map units per unit of the depth images; 0 = no depth
};

// Reads camera.yaml: width, height, fx, fy, cx, cy [px, integer pixel = pixel centre]; optional lens
// (radial-tangential, or fisheye), distortion (k1 k2 p1 p2 k3, or k1 k2 k3 k4 of a fisheye), fps and depth_scale.
// NOT_FOUND or INVALID_ARGUMENT naming file, line and what is missing or impossible.
absl::StatusOr<CameraYaml> ReadCameraYaml(const std::string& path);

absl::Status WriteCameraYaml(const std::string& path, const CameraYaml& camera);

}  // namespace romap::files
