#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <unordered_map>

#include "common/cuboid.h"
#include "common/stage_messages.h"

namespace romap::objects {

// A MapCorrection's keyframes by id. What is not in it did not move noticeably.
using KeyframeCorrections = std::unordered_map<KeyframeId, KeyframeCorrection>;

// What the space around an object underwent according to the keyframes that saw it: the mean rotation, the mean motion
// of its centre and the geometric mean of the scales. The keyframes decide and not the object's points, because masks
// and fields hang on cameras only; what the keyframes disagree on is left to the single views. nullopt when none of
// `seen_in` was corrected.
std::optional<Sim3<World, World>> MeanMotion(std::span<const KeyframeId> seen_in, const Eigen::Vector3d& center_world,
                                             const KeyframeCorrections& corrections);

// The cuboid turned about its centre, the shortest way, so that its z axis is up.
Cuboid Upright(Cuboid cuboid, const Eigen::Vector3d& up_world);

// How far apart in the image, at most, two poses of a camera see the corners of a cuboid. Infinite when a corner is
// behind only one of them.
double LargestShift_px(const Cuboid& cuboid, const CameraModel& camera, const SE3<World, Camera>& T_world_camera_a,
                       const SE3<World, Camera>& T_world_camera_b);

}  // namespace romap::objects
