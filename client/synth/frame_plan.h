#pragma once

#include <cstddef>
#include <vector>

#include "client/synth/options.h"

namespace romap::synth {

// What happens to one frame on its way from the scene to the folder.
struct FramePlan {
  bool missing = false;  // it is not there at all
  size_t shown = 0;      // index of the frame whose picture it shows: its own, or an earlier one
  bool black = false;
  bool blurred = false;
  double gain = 1;   // of the 8-bit values, after gamma
  double gamma = 1;  // exponent of the values as shares of 255
};

// One plan per frame, by options.seed. Frame i has the number i + 1 in the options' ranges. A frame that shows an
// earlier picture shares that picture's faults.
std::vector<FramePlan> PlanFrames(const SynthOptions& options);

}  // namespace romap::synth
