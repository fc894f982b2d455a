#pragma once

#include <optional>
#include <string>

#include "common/geometry.h"
#include "common/status.h"

namespace romap::files {

// How a file of poses differs from the default: camera to world, camera x right, y down, z forward, quaternions
// x y z w. All of it may apply at once.
struct PoseConvention {
  bool wxyz = false;             // the quaternions are w x y z
  bool world_to_camera = false;  // the poses are T_camera_world
  bool opengl = false;           // the camera has OpenGL's axes: x right, y up, z backward
  // The poses are those of a body that carries the camera: T_body_camera.
  std::optional<SE3<Camera, Camera>> offset = std::nullopt;
};

// Sets one of the names opencv (nothing), opengl, world_to_camera, wxyz, or several of them separated by commas.
// INVALID_ARGUMENT names an unknown one.
absl::Status ParseConvention(const std::string& names, PoseConvention* convention);

// Parses "tx ty tz qx qy qz qw". INVALID_ARGUMENT: not seven finite numbers, or the norm of the quaternion differs from
// 1 by more than 5 %.
absl::StatusOr<SE3<Camera, Camera>> ParsePoseOffset(const std::string& text);

// The pose of the camera for a pose of the file whose quaternion was read as x y z w.
SE3<World, Camera> ApplyConvention(const PoseConvention& convention, const SE3<World, Camera>& pose);

}  // namespace romap::files
