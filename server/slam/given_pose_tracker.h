#pragma once

#include <memory>

#include "server/slam/keyframe_selector.h"
#include "server/slam/slam_config.h"
#include "server/slam/tracker.h"
#include "server/slam/up_estimator.h"

namespace romap {

// The tracker for clients that know their camera poses: takes Frame::T_world_camera as it is, however far it jumps, and
// chooses the keyframes.
class GivenPoseTracker : public Tracker {
 public:
  explicit GivenPoseTracker(const SlamConfig& config) : selector_(config) {}

  // FAILED_PRECONDITION, naming the frame, when it brings no pose.
  absl::StatusOr<TrackedFrame> Track(std::shared_ptr<const Frame> frame) override;

 private:
  KeyframeSelector selector_;
  UpEstimator up_;
};

}  // namespace romap
