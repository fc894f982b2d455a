#pragma once

#include <cstddef>
#include <vector>

#include "client/files/sequence.h"
#include "client/files/tum.h"

namespace romap::files {

struct PosedFrame {
  size_t index = 0;  // in the sequence
  SE3<World, Camera> T_world_camera;
};

// The frames of a sequence that have a pose in `trajectory` (same timestamp), in order.
std::vector<PosedFrame> MappedFrames(const Sequence& sequence, const std::vector<StampedPose>& trajectory);

}  // namespace romap::files
