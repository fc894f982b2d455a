#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <numbers>
#include <optional>
#include <vector>

#include "common/stage_messages.h"
#include "server/slam/slam_map.h"
#include "server/slam/up_estimator.h"

namespace romap::slam {

// Estimates the up direction of a map that was initialized from images alone: opposite to the client's gravity if the
// client sends it, else from what the map shows: the plane that supports the objects (support_plane.h) and cameras that
// are held level (level_cameras.h), weighed against each other (up_fusion.h). Until there is evidence, the world keeps
// the up direction it was initialized with. Evidence that is too weak or contradictory still turns the world, because
// it is the best guess, but up counts as unknown.
class WorldUp {
 public:
  // `keyframes_used`: ids used by earlier maps of the session.
  explicit WorldUp(uint64_t keyframes_used = 0) : next_fit_(keyframes_used + 2) {}

  // Uses the gravity of a tracked frame, if it has any.
  void ObserveGravity(const Frame& frame, const SE3<World, Camera>& T_world_camera);
  // Call after each keyframe. Returns the rotation R_new_old about the world's origin that makes z up, unless it is
  // unknown or too small to be useful. `is_last`: the map is finished; small rotations are returned too.
  std::optional<Eigen::Quaterniond> ProposeRotation(const SlamMap& map, bool is_last = false);
  // The whole map changed: the next ProposeRotation() evaluates it again.
  void RequestUpdate() { next_fit_ = 0; }
  // What to assume before there is evidence, unit length; ignored afterward.
  void Assume(const Eigen::Vector3d& up_world);
  // The world was rotated.
  void Rotate(const Eigen::Quaterniond& R_new_old);

  // The estimate, unit length. Before there is evidence, that of the start: z.
  const Eigen::Vector3d& up_world() const { return up_world_; }
  double confidence() const { return confidence_; }  // 0..1
  // Standard deviation of the up direction.
  double sigma_rad() const { return sigma_rad_; }
  // Whether the evidence determines up. If not, Diagnostics() says so.
  bool is_known() const;
  std::vector<Diagnostic> Diagnostics() const;
  // Whether the estimate is about the normal of the surface under the objects.
  bool rests_on_support() const { return rests_on_support_; }

 private:
  bool UpdateFromMap(const SlamMap& map, bool is_last);

  UpEstimator gravity_;
  bool has_gravity_ = false;
  Eigen::Vector3d up_world_ = Eigen::Vector3d::UnitZ();
  double confidence_ = 0;
  double sigma_rad_ = std::numbers::pi;
  bool rests_on_support_ = false;
  uint64_t next_fit_;  // number of keyframes at which the map is evaluated again
};

}  // namespace romap::slam
