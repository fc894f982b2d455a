#pragma once

#include <cstdint>

#include "client/bench/true_views.h"

namespace romap::measure {

// How wrong the poses and masks of frames are made. All off by default.
struct FrameNoise {
  double pose_deg = 0;  // standard deviation of a camera's rotation, about each of its axes
  double pose_cm = 0;   // and of its center, along each axis, of the sequence's metres
  double mask_px = 0;   // masks' borders are displaced by up to so much, smoothly along the border
  uint64_t seed = 1;
};

// The frames with noise on every one. What happens to a frame follows from the seed and the frame's id alone.
bench::TrueFrames WithNoise(const bench::TrueFrames& frames, const FrameNoise& noise);

}  // namespace romap::measure
