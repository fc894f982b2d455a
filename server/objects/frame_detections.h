#pragma once

#include <cstdint>
#include <vector>

#include "server/objects/detections.h"
#include "server/objects/point_registry.h"

namespace romap::objects {

// The detections of one frame and the landmarks they were assigned to.
struct FrameDetections {
  bool usable = false;  // the frame has a pose and masks
  uint64_t frame_id = 0;
  std::vector<Detection> detections;
  std::vector<LandmarkKey> keys;  // per detection: its landmark or kNoLandmark
  std::vector<bool> unambiguous;  // per detection: may update the landmark's shape and points
};

}  // namespace romap::objects
