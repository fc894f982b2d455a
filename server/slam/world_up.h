#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>

#include "common/stage_messages.h"
#include "server/slam/slam_map.h"
#include "server/slam/up_estimator.h"

namespace romap::slam {

// Estimates the up direction of a map that was initialized from images alone: opposite to the client's gravity if the
// client sends it, else the normal of the plane that supports the objects (support_plane.h). Until one of them is
// known, the world keeps the up direction it was initialized with.
class WorldUp {
 public:
  // `keyframes_used`: ids used by earlier maps of the session.
  explicit WorldUp(uint64_t keyframes_used = 0) : next_fit_(keyframes_used + 2) {}

  // Uses the gravity of a tracked frame, if it has any.
  void ObserveGravity(const Frame& frame, const SE3<World, Camera>& T_world_camera);
  // Call after each keyframe. Returns the rotation R_new_old about the world's origin that makes z up, unless it is
  // unknown or too small to be useful. `is_last`: the map is finished; small rotations are returned too.
  std::optional<Eigen::Quaterniond> ProposeRotation(const SlamMap& map, bool is_last = false);
  // The whole map changed: the next ProposeRotation() fits the support plane again.
  void RequestUpdate() { next_fit_ = 0; }
  // The world was rotated.
  void Rotate(const Eigen::Quaterniond& R_new_old);

  double confidence() const { return confidence_; }  // 0..1

 private:
  UpEstimator gravity_;
  bool has_gravity_ = false;
  double confidence_ = 0;
  uint64_t next_fit_;  // number of keyframes at which the support plane is fitted again
};

}  // namespace romap::slam
