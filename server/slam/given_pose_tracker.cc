#include "server/slam/given_pose_tracker.h"

#include <utility>

#include "common/status.h"

namespace romap {

absl::StatusOr<TrackedFrame> GivenPoseTracker::Track(std::shared_ptr<const Frame> frame) {
  if (!frame->T_world_camera) {
    return FailedPrecondition(
        "frame {}: no camera pose (T_world_camera); every frame must bring one, this server does not track from images",
        frame->frame_id);
  }
  TrackedFrame tracked;
  tracked.T_world_camera = *frame->T_world_camera;
  up_.Add(*frame, tracked.T_world_camera);
  tracked.up_world = up_.up_world();
  tracked.is_keyframe = selector_.IsKeyframe(*frame, tracked.T_world_camera);
  tracked.frame = std::move(frame);
  return tracked;
}

}  // namespace romap
