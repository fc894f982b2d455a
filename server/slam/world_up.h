#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>

#include "common/stage_messages.h"
#include "server/slam/slam_map.h"
#include "server/slam/up_estimator.h"

namespace romap::slam {

// Which way is up in a map that was begun from images alone: against the client's gravity where it sends one, else the
// normal of the plane that the objects stand on (support_plane.h), else, at the very beginning, the camera's own up.
class WorldUp {
 public:
  // `keyframes_used`: ids that an earlier map of the session used up.
  explicit WorldUp(uint64_t keyframes_used = 0) : next_try_(keyframes_used + 2) {}

  // A tracked frame: its gravity counts.
  void Observe(const Frame& frame, const SE3<World, Camera>& T_world_camera);
  // Called after each keyframe: a turn of the world that makes z up, if there is one worth making. Turns around the
  // world's origin. At the end of a map (`is_last`) every turn is.
  std::optional<Eigen::Quaterniond> Correct(const SlamMap& map, bool is_last = false);
  // The map changed as a whole: Correct looks again at once.
  void LookAgain() { next_try_ = 0; }
  // The world was turned as said.
  void Turned(const Eigen::Quaterniond& R_new_old);

  double confidence() const { return confidence_; }  // 0..1

 private:
  UpEstimator gravity_;
  bool has_gravity_ = false;
  double confidence_ = 0;
  uint64_t next_try_;  // keyframes
};

}  // namespace romap::slam
