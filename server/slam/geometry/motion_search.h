#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/slam/geometry/epipolar.h"

namespace romap::slam {

// The result of RANSAC: approximate models from minimal samples.
struct MotionSearch {
  std::vector<Motion> motions;                // the best by five matches, best first, no two alike
  double essential_support = 0;               // of the best, sides of the camera aside
  std::optional<Eigen::Matrix3d> homography;  // the best by four matches, refined
  double homography_support = 0;
};

// Fits essential matrices (to five matches, Nister 2004) and homographies (to four of them) to the same samples, for
// at most `max_iterations` or until a sample without outliers is all but certain.
MotionSearch SearchMotions(const CameraModel& camera, std::span<const RayMatch> matches, int max_iterations,
                           uint64_t seed);

// Whether two motions differ by less than these angles.
bool AreAlike(const Motion& a, const Motion& b, double rotation_rad, double direction_rad);

}  // namespace romap::slam
