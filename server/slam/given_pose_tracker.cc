#include "server/slam/given_pose_tracker.h"

#include <utility>

namespace romap::slam {

TrackedFrame GivenPoseTracker::Track(std::shared_ptr<const Frame> frame) {
  TrackedFrame tracked;
  tracked.T_world_camera = *frame->T_world_camera;
  up_.Add(*frame, tracked.T_world_camera);
  tracked.up_world = up_.up_world();
  tracked.is_keyframe = selector_.IsKeyframe(*frame, tracked.T_world_camera);
  tracked.frame = std::move(frame);
  return tracked;
}

}  // namespace romap::slam
