#pragma once

#include <span>
#include <string>
#include <vector>

#include "common/camera_model.h"
#include "common/geometry.h"
#include "server/slam/geometry/two_view.h"

namespace romap::slam {

// A way to read the poses and the intrinsics of a client. All false and 1: as they are given.
struct PoseHypothesis {
  bool wxyz = false;             // the quaternions have w first: what was read as x y z w is w x y z
  bool world_to_camera = false;  // the poses are T_camera_world
  bool opengl = false;           // the camera has OpenGL's axes: x right, y up, z backward
  double resolution_factor = 1;  // focal length and principal point belong to another resolution
  double focal_factor = 1;       // only the focal length does
  bool mirrored = false;         // left and right of the images are exchanged
  bool upside_down = false;      // top and bottom of the images are exchanged; with `mirrored`: a half turn

  bool IsCalibration() const { return resolution_factor != 1 || focal_factor != 1; }
  bool IsFlip() const { return mirrored || upside_down; }
  bool operator==(const PoseHypothesis&) const = default;
};

// As given first, then the conventions, alone before combined, then flipped images and calibrations.
const std::vector<PoseHypothesis>& AllPoseHypotheses();

// The pose or camera that a client means, if the hypothesis is true.
SE3<World, Camera> ReadPose(const PoseHypothesis& hypothesis, const SE3<World, Camera>& given);
CameraModel ReadCamera(const PoseHypothesis& hypothesis, const CameraModel& given);

// T_second_first of two given poses, read by the hypothesis.
SE3<Camera, Camera> ReadMotion(const PoseHypothesis& hypothesis, const SE3<World, Camera>& first,
                               const SE3<World, Camera>& second);

// Per match: whether the motion T_second_first explains it within a distance.
std::vector<bool> Explained(const CameraModel& camera, const SE3<Camera, Camera>& motion,
                            std::span<const TwoViewMatch> matches, double max_distance_px);
// Share of the true values.
double ShareOf(const std::vector<bool>& explained);

// For users: "as world-to-camera and with OpenGL camera axes".
std::string Describe(const PoseHypothesis& hypothesis);
// What a user does about flipped images.
inline constexpr const char* kFlipAdvice = "send the images and masks as the camera took them, not flipped or turned";
// Of the option --pose-convention of the client: "world_to_camera,opengl".
std::string ConventionOption(const PoseHypothesis& hypothesis);

}  // namespace romap::slam
