#pragma once

#include <deque>
#include <optional>

#include "common/stage_messages.h"
#include "server/slam/scene_depth.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// How well a frame was tracked from its image.
struct TrackingQuality {
  double scene_depth_mu = 0;      // median over the points it saw
  double tracked_share = 1;       // points found, over those that the newest keyframe saw
  int keyframes_waiting = 0;      // chosen, but not yet in the map
  bool has_unseen_depth = false;  // its depth image would give many new points
};

// Chooses keyframes from camera poses: one is due when the camera has turned or moved enough since the last one, or
// when it has moved at all and much time has passed; a camera that stands still gets no more. A due keyframe waits a
// few frames for one that is sharp and, where masks come with some frames only, has masks.
class KeyframeSelector {
 public:
  explicit KeyframeSelector(const SlamConfig& config) : config_(config) {}

  // Is this frame a keyframe? Call once per frame, in order. The first frame always is.
  bool IsKeyframe(const Frame& frame, const SE3<World, Camera>& T_world_camera);

  // The same for a pose that was tracked from the image. A keyframe is also due when the map runs out of points; while
  // earlier ones wait to be mapped, only what tracking needs is taken.
  bool IsKeyframe(const Frame& frame, const SE3<World, Camera>& T_world_camera, const TrackingQuality& quality);

 private:
  // How far the camera has come towards the next keyframe; 1 = there.
  double Progress(const SE3<World, Camera>& T_world_camera) const;
  bool IsDue(const DepthView& view);
  bool IsGood(const Frame& frame, double sharpness);
  void Take(DepthView view);

  const SlamConfig config_;
  std::optional<DepthView> last_keyframe_;
  std::optional<double> scene_depth_mu_;
  bool depth_is_of_keyframe_ = false;  // scene_depth_mu_ was measured from the last keyframe, not from an earlier one
  int frames_since_keyframe_ = 0;
  int frames_due_ = 0;
  int frames_since_mask_ = 1 << 20;
  std::deque<double> recent_sharpness_;
};

}  // namespace romap::slam
