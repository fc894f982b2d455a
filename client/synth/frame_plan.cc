#include "client/synth/frame_plan.h"

#include <algorithm>
#include <cmath>

#include "client/synth/random.h"

namespace romap::synth {
namespace {

bool InAny(const std::vector<FrameRange>& ranges, size_t frame) {
  return std::any_of(ranges.begin(), ranges.end(),
                     [&](const FrameRange& range) { return range.Contains(static_cast<int>(frame) + 1); });
}

// Simulates automatic exposure that changes every second or two.
void PlanExposure(const SynthOptions& options, std::vector<FramePlan>& plans) {
  Random random(options.seed, 8);
  double next_jump_s = 0;
  double gain = 1;
  double gamma = 1;
  for (size_t i = 0; i < plans.size(); ++i) {
    const double time_s = static_cast<double>(i) / options.fps;
    if (time_s >= next_jump_s) {
      gain = std::exp2(options.exposure_stops * random.Uniform(-1, 1));
      gamma = std::exp2(0.3 * options.exposure_stops * random.Uniform(-1, 1));
      next_jump_s = time_s + random.Uniform(0.8, 2.2);
    }
    plans[i].gain = gain;
    plans[i].gamma = gamma;
  }
}

// Simulates an automatic exposure that changes in steps. Starts with a gain of 1.
void PlanGainSteps(const SynthOptions& options, std::vector<FramePlan>& plans) {
  Random random(options.seed, 10);
  const double log_low = std::log(options.gain_steps.low);
  const double log_range = std::log(options.gain_steps.high) - log_low;
  double next_step_s = random.Uniform(0.8, 2.2);
  double share = random.Uniform();  // of the range
  double gain = 1;
  for (size_t i = 0; i < plans.size(); ++i) {
    const double time_s = static_cast<double>(i) / options.fps;
    if (time_s >= next_step_s) {
      share += random.Uniform(0.25, 0.75);
      share -= std::floor(share);
      gain = std::exp(log_low + share * log_range);
      next_step_s = time_s + random.Uniform(0.8, 2.2);
    }
    plans[i].gain *= gain;
  }
}

}  // namespace

std::vector<FramePlan> PlanFrames(const SynthOptions& options) {
  std::vector<FramePlan> plans(static_cast<size_t>(options.frames));
  if (options.exposure_stops > 0) PlanExposure(options, plans);
  if (options.gain_steps != GainRange{}) PlanGainSteps(options, plans);
  Random random(options.seed, 7);
  for (size_t i = 0; i < plans.size(); ++i) {
    FramePlan& plan = plans[i];
    plan.missing = InAny(options.cuts, i);
    plan.black = InAny(options.black, i);
    plan.blurred = InAny(options.blurred, i);
    plan.shown = i;
    const bool repeat = random.Chance(options.duplicate_share);
    // No repetition across the limits of a range: a covered lens must not show an earlier image, and vice versa.
    const bool same_faults = i > 0 && !plan.missing && !plans[i - 1].missing && plan.black == plans[i - 1].black &&
                             plan.blurred == plans[i - 1].blurred;
    if (repeat && same_faults) plan = plans[i - 1];
  }
  return plans;
}

}  // namespace romap::synth
