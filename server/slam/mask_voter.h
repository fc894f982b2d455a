#pragma once

#include <cstdint>
#include <deque>

#include "common/stage_messages.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Assigns masks to map points if the masks arrive after their frame or belong to a frame that is not a keyframe. Both
// are common with slow detectors. Masks of a keyframe label its features. Masks of another frame count as votes
// (PointTrack::votes) for the points of its reference keyframe, unless that keyframe has masks, because then the votes
// add no information.
class MaskVoter {
 public:
  explicit MaskVoter(const SlamConfig& config) : config_(config) {}

  // A frame that was tracked against the map and is not a keyframe. Call in the order of frames.
  void ObserveFrame(const TrackedFrame& tracked, SlamMap& map);
  // Masks that arrived after their frame. Ignored if the frame is no longer stored.
  void ObserveMasks(const FrameMasks& masks, SlamMap& map);

 private:
  // A frame whose masks may still arrive; see TrackedFrame.
  struct WaitingFrame {
    uint64_t frame_id = 0;
    CameraModel camera;
    KeyframeId reference;
    SE3<Camera, Camera> T_reference_camera;
  };

  void Vote(const WaitingFrame& frame, const cv::Mat& labels, SlamMap& map) const;

  SlamConfig config_;
  std::deque<WaitingFrame> waiting_;
};

}  // namespace romap::slam
