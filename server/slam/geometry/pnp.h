#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "server/slam/geometry/pose_refiner.h"

namespace romap::slam {

struct PnpOptions {
  int max_iterations = 300;
  int min_inliers = 15;
  uint64_t seed = 1;
};

// The camera pose from points that may be wrongly matched: P3P in RANSAC (preemptive adaptive stop), then RefinePose on
// the inliers. nullopt when no pose has `min_inliers`. The same input and seed give the same result.
std::optional<PoseEstimate> SolvePnp(const CameraModel& camera, std::span<const PoseObservation> observations,
                                     const PnpOptions& options);

}  // namespace romap::slam
