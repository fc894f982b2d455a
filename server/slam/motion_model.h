#pragma once

#include <cstdint>
#include <optional>

#include "common/scaled_pose.h"
#include "common/stage_messages.h"
#include "server/slam/rolling_shutter.h"

namespace romap::slam {

// The pose of the last tracked frame and the motion that led to it; predicts the pose of the next frame.
class MotionModel {
 public:
  // Discards the last pose and the motion.
  void Reset();
  bool HasMotion() const { return motion_.has_value(); }
  // Discards the motion, but keeps the last pose.
  void ResetMotion() { motion_.reset(); }
  // Records a tracked frame. `prior`: the client's pose of it, if any. `is_continuous`: the motion since the last frame
  // is usable; false if tracking was lost in between.
  void Update(const SE3<World, Camera>& T_world_camera, const std::optional<SE3<World, Camera>>& prior,
              int64_t timestamp_ns, bool is_continuous);
  // The map around a keyframe was corrected: the last pose and the motion move with it.
  void Correct(const ScaledPose& before, const ScaledPose& after);

  const std::optional<SE3<World, Camera>>& last_pose() const { return last_pose_; }
  // The pose of `frame`, assuming constant velocity; the last pose if the motion is unknown. `use_prior`: the motion
  // between the client's poses takes precedence. Requires a last pose.
  SE3<World, Camera> Predict(const Frame& frame, bool use_prior) const;

  // The motion while a frame is read, for a rolling shutter: predicted from the last motion, or from the last pose and
  // that of the frame. It has no `depth_mu`. nullopt if the motion is unknown or the last frame is too old.
  std::optional<ReadoutMotion> PredictReadout(double readout_s, int64_t timestamp_ns) const;
  std::optional<ReadoutMotion> ReadoutTo(const SE3<World, Camera>& T_world_camera, double readout_s,
                                         int64_t timestamp_ns) const;

 private:
  std::optional<SE3<World, Camera>> last_pose_;
  std::optional<SE3<World, Camera>> last_prior_;  // the client's pose of the last tracked frame
  int64_t last_timestamp_ns_ = 0;
  std::optional<SE3<Camera, Camera>> motion_;  // T_previous_last
  double motion_duration_s_ = 0;               // duration of `motion_`
};

// Whether a pose is as close to its prediction by a known motion as the acceleration of a hand, a robot or a headset
// between two frames allows. `depth_mu`: of the scene; the unit of length is arbitrary.
bool IsPlausible(const SE3<World, Camera>& predicted, const SE3<World, Camera>& pose, double depth_mu);

}  // namespace romap::slam
