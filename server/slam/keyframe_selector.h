#pragma once

#include <deque>
#include <optional>

#include "common/stage_messages.h"
#include "server/slam/scene_depth.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// How well a frame was tracked from its image.
struct TrackingQuality {
  double scene_depth_mu = 0;   // median over its matched points
  double tracked_share = 1;    // matched points over the points of the newest keyframe
  int keyframes_waiting = 0;   // selected, but not yet in the map
  bool has_new_depth = false;  // its depth image would add many points
};

// Selects keyframes by camera poses: one is due when the camera has rotated or moved enough since the last one, or has
// moved slightly and the last keyframe is many frames old. A static camera gets no further keyframes. A due keyframe
// waits a few frames for a frame that is sharp and, if only some frames have masks, has masks.
class KeyframeSelector {
 public:
  explicit KeyframeSelector(const SlamConfig& config) : config_(config) {}

  // Whether this frame is a keyframe. Call once per frame, in order. The first frame is always a keyframe.
  bool IsKeyframe(const Frame& frame, const SE3<World, Camera>& T_world_camera);

  // The same for a pose that was tracked from the image. A keyframe is also due when few map points are still
  // in view. While earlier keyframes wait for mapping, only those that tracking needs are selected.
  bool IsKeyframe(const Frame& frame, const SE3<World, Camera>& T_world_camera, const TrackingQuality& quality);

  // The camera is in another map now: its first frame is a keyframe.
  void ForgetLastKeyframe() { last_keyframe_.reset(); }

 private:
  // Motion since the last keyframe, divided by the motion that makes the next one due.
  double Progress(const SE3<World, Camera>& T_world_camera) const;
  bool IsDue(const DepthView& view);
  bool IsSharpWithMasks(const Frame& frame, double sharpness);
  void SetLastKeyframe(DepthView view);

  const SlamConfig config_;
  std::optional<DepthView> last_keyframe_;
  std::optional<double> scene_depth_mu_;
  bool depth_is_of_keyframe_ = false;  // scene_depth_mu_ was measured from the last keyframe
  int frames_since_keyframe_ = 0;
  int frames_due_ = 0;
  int frames_since_mask_ = 1 << 20;
  std::deque<double> recent_sharpness_;
};

}  // namespace romap::slam
