#pragma once

#include <cstdint>
#include <deque>

#include "common/stage_messages.h"
#include "server/slam/rolling_shutter.h"

namespace romap::slam {

// Converts the tracked frames of a rolling shutter for the later stages, and their masks, which may arrive later.
class FrameConverter {
 public:
  // Replaces the frame by the one that a global shutter would have taken; its image only if it is a keyframe.
  void Convert(const RollingShutter& shutter, TrackedFrame& tracked);
  // As Convert() did with the frame.
  FrameMasks ConvertMasks(const FrameMasks& masks) const;

 private:
  struct FrameShutter {
    uint64_t frame_id = 0;
    RollingShutter shutter;
  };
  std::deque<FrameShutter> without_masks_;  // the last frames without masks
};

}  // namespace romap::slam
