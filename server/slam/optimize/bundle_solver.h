#pragma once

#include <cstdint>
#include <vector>

#include "server/slam/optimize/bundle_adjustment.h"

namespace romap::slam {

// The 95 % bounds of the chi-square distribution with two and three degrees of freedom.
inline constexpr double kChi2Bound2 = 5.991;
inline constexpr double kChi2Bound3 = 7.815;

inline bool HasDepth(const BundleObservation& observation) {
  return observation.depth_mu > 0 && observation.depth_sigma_mu > 0;
}

// One run of Ceres on a bundle problem.
struct BundleRun {
  int iterations = 0;
  bool usable = false;     // false: the problem is unchanged
  bool converged = false;  // more iterations would not change it
  bool aborted = false;
  double trust_region_radius = 1e4;  // in: initial value. out: final value
};

// Moves the free cameras and points of `problem` so that the observations with `use` != 0 fit best. These must be
// valid: indices in range, finite numbers, sigmas > 0, depths finite.
void RunBundle(BundleProblem& problem, const std::vector<uint8_t>& use, const BundleOptions& options,
               int max_iterations, BundleRun& run);

}  // namespace romap::slam
