#pragma once

#include <cstddef>
#include <vector>

#include "client/files/sequence.h"
#include "client/files/tum.h"

namespace romap {

struct MappedFrame {
  size_t index = 0;  // in the sequence
  SE3<World, Camera> T_world_camera;
};

// The frames of a sequence that got a pose, in the order of the sequence.
std::vector<MappedFrame> MappedFrames(const Sequence& sequence, const std::vector<StampedPose>& trajectory);

}  // namespace romap
