#pragma once

#include <cstdint>

#include "client/bench/true_views.h"

namespace romap::measure {

// Noise to add to the poses and masks of frames. None by default.
struct FrameNoise {
  double pose_deg = 0;  // standard deviation of a camera's rotation, about each of its axes
  double pose_cm = 0;   // and of its center, along each axis [cm; the sequence is in meters]
  double mask_px = 0;   // maximum displacement of mask borders, which varies smoothly along the border
  uint64_t seed = 1;
};

// Adds noise to all frames. The noise of a frame depends only on the seed and the frame's id.
bench::TrueFrames WithNoise(const bench::TrueFrames& frames, const FrameNoise& noise);

}  // namespace romap::measure
