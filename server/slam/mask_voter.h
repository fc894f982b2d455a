#pragma once

#include <cstdint>
#include <deque>

#include "common/stage_messages.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Ties masks to map points where the labels of keyframes' features do not: a slow detector's masks come after their
// frame, and mostly of frames that are no keyframes. Masks of a keyframe label its features. Those of another frame
// count as votes (PointTrack::votes) for the points that its reference keyframe sees, as long as that one has no masks
// of its own, which say the same.
class MaskVoter {
 public:
  explicit MaskVoter(const SlamConfig& config) : config_(config) {}

  // A frame tracked against the map that became no keyframe, in order.
  void ObserveFrame(const TrackedFrame& tracked, SlamMap& map);
  // Masks of an earlier frame that had none; passed over when the frame is not known any more.
  void ObserveMasks(const FrameMasks& masks, SlamMap& map);
  // The map was begun anew.
  void Forget() { passed_.clear(); }

 private:
  // A frame without masks, see TrackedFrame.
  struct PassedFrame {
    uint64_t frame_id = 0;
    CameraModel camera;
    KeyframeId reference;
    SE3<Camera, Camera> T_reference_camera;
  };

  void Vote(const PassedFrame& frame, const cv::Mat& labels, SlamMap& map) const;

  const SlamConfig config_;
  std::deque<PassedFrame> passed_;
};

}  // namespace romap::slam
