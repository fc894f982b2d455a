#pragma once

#include <cstddef>
#include <vector>

#include "client/synth/options.h"

namespace romap::synth {

// The image faults of one frame.
struct FramePlan {
  bool missing = false;  // the frame is omitted
  size_t shown = 0;      // index of the frame whose image is shown: this frame or an earlier one
  bool black = false;
  bool blurred = false;
  double gain = 1;   // factor of the 8-bit values, after gamma
  double gamma = 1;  // exponent of value / 255
};

// Returns one plan per frame, determined by options.seed. Frame i has number i + 1 in the ranges of `options`. A frame
// that repeats an earlier image has the faults of that image.
std::vector<FramePlan> PlanFrames(const SynthOptions& options);

}  // namespace romap::synth
