#pragma once

#include <memory>

#include "common/stage_messages.h"
#include "server/slam/keyframe_selector.h"
#include "server/slam/slam_config.h"
#include "server/slam/up_estimator.h"

namespace romap::slam {

// Tracks frames with a given camera pose: uses Frame::T_world_camera without any check and selects the keyframes.
class GivenPoseTracker {
 public:
  explicit GivenPoseTracker(const SlamConfig& config) : selector_(config) {}

  // `frame` must have a pose.
  TrackedFrame Track(std::shared_ptr<const Frame> frame);

 private:
  KeyframeSelector selector_;
  UpEstimator up_;
};

}  // namespace romap::slam
