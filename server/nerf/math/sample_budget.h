#pragma once

// Number of samples per ray, and number of rays per block of samples.

#include "server/nerf/math/target.h"

namespace romap::nerf {

struct SampleBudget {
  float finest_step = 0.01f;  // box sides; minimum distance of samples, unless min_samples requires a smaller one
  int min_samples = 4;
  int max_samples = 16;
  bool skip_empty = true;  // false: `max_samples` between entry and exit of the box, in occupied and empty space
};

// Number of samples of a ray whose occupied pieces have the total length `length` [box sides].
ROMAP_HD int SampleCount(const SampleBudget& budget, float length) {
  if (!(length > 1e-6f)) return 0;
  if (!budget.skip_empty) return budget.max_samples;
  const int wanted = static_cast<int>(length / budget.finest_step) + 1;
  return wanted < budget.min_samples ? budget.min_samples : wanted > budget.max_samples ? budget.max_samples : wanted;
}

// Rays whose samples fit into a block of `samples`: an even number, so that partners (see RayTarget) stay together.
ROMAP_HD int RaysThatFit(int samples, int samples_per_ray) { return samples / samples_per_ray / 2 * 2; }

}  // namespace romap::nerf
