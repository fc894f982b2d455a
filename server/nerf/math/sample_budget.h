#pragma once

// Number of samples per ray, and number of rays per block of samples.

#include "server/nerf/math/target.h"

namespace romap::nerf {

struct SampleBudget {
  float finest_step = 0.01f;  // box sides; samples are not closer than this, unless there would be fewer than `least`
  int least = 4;
  int most = 16;
  bool skip_empty = true;  // false: `most` samples between entry and exit of the box, in occupied and empty space
};

// Number of samples of a ray whose occupied pieces have the total length `length` [box sides].
ROMAP_HD int SampleCount(const SampleBudget& budget, float length) {
  if (!(length > 1e-6f)) return 0;
  if (!budget.skip_empty) return budget.most;
  const int wanted = static_cast<int>(length / budget.finest_step) + 1;
  return wanted < budget.least ? budget.least : wanted > budget.most ? budget.most : wanted;
}

// Rays whose samples fit into a block of `samples`: an even number, so that partners (see RayTarget) stay together.
ROMAP_HD int RaysThatFit(int samples, int samples_per_ray) { return samples / samples_per_ray / 2 * 2; }

}  // namespace romap::nerf
