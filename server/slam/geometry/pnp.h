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

// Estimates the camera pose from matches with outliers: P3P in RANSAC with an adaptive number of iterations, then
// RefinePose. nullopt if no pose has `min_inliers`. Deterministic for the same input and seed.
std::optional<PoseEstimate> SolvePnp(const CameraModel& camera, std::span<const PoseObservation> observations,
                                     const PnpOptions& options);

}  // namespace romap::slam
