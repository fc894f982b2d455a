#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <unordered_map>

#include "common/cuboid.h"
#include "common/stage_messages.h"

namespace romap::objects {

// A MapCorrection's keyframes by id. Keyframes that are not listed did not move noticeably.
using KeyframeCorrections = std::unordered_map<KeyframeId, KeyframeCorrection>;

// The motion of the space around an object according to the keyframes that observed it: the mean rotation, the mean
// motion of the object's center and the geometric mean of the scales. It follows the keyframes and not the object's
// points, because masks and fields depend on camera poses only. The residual motion of each keyframe changes the views.
// nullopt when none of `observed_in` was corrected.
std::optional<Sim3<World, World>> MeanMotion(std::span<const KeyframeId> observed_in,
                                             const Eigen::Vector3d& center_world,
                                             const KeyframeCorrections& corrections);

// The cuboid with the smallest rotation about its center that makes its z axis point up.
Cuboid Upright(Cuboid cuboid, const Eigen::Vector3d& up_world);

// The largest distance in the image between the projections of a cuboid's corners with two poses of a camera. Infinite
// when a corner is behind the camera with only one of them.
double LargestShift_px(const Cuboid& cuboid, const CameraModel& camera, const SE3<World, Camera>& T_world_camera_a,
                       const SE3<World, Camera>& T_world_camera_b);

}  // namespace romap::objects
