#pragma once

#include <string>
#include <vector>

#include "common/camera_model.h"
#include "common/status.h"

namespace romap::files {

// The contents of camera.yaml.
struct CameraYaml {
  CameraModel camera;
  double fps = 30;         // nominal frames per second
  double depth_scale = 0;  // map units per unit of the depth images; 0 = no depth
  // Up in the world of the poses: "x" to "-z", or "auto" if it is not known; empty: not stated.
  std::string world_up = {};
};

// The values of CameraYaml::world_up.
inline const std::vector<std::string> kWorldUps = {"x", "-x", "y", "-y", "z", "-z", "auto"};

// Reads camera.yaml: width, height, fx, fy, cx, cy [px; pixel centers are at integer coordinates]; optional lens
// (radial-tangential or fisheye), distortion (k1 k2 p1 p2 k3, or k1 k2 k3 k4 for a fisheye), readout_s (see
// CameraModel), fps, depth_scale and world_up. INVALID_ARGUMENT names the file, the line and the missing or invalid
// value. Otherwise as ReadFile.
absl::StatusOr<CameraYaml> ReadCameraYaml(const std::string& path);

// Writes the format of ReadCameraYaml. Errors as WriteFile.
absl::Status WriteCameraYaml(const std::string& path, const CameraYaml& camera);

}  // namespace romap::files
