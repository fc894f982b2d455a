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
  std::vector<Motion> motions;                // from five matches each, best first, without near duplicates
  double essential_support = 0;               // of the best essential matrix; points behind a camera count
  std::optional<Eigen::Matrix3d> homography;  // the best one from four matches, refined
  double homography_support = 0;
};

// RANSAC: fits essential matrices (five matches, Nister 2004) and homographies (four of these matches) to the same
// samples. Stops after `max_iterations`, or when a sample without outliers has almost certainly been drawn.
MotionSearch SearchMotions(const CameraModel& camera, std::span<const RayMatch> matches, int max_iterations,
                           uint64_t seed);

// The best motion of a search, refined; nullopt if the search finds none.
std::optional<Motion> FindMotion(const CameraModel& camera, std::span<const RayMatch> matches, int max_iterations,
                                 uint64_t seed);

// Whether two motions differ by less than these angles.
bool AreSimilar(const Motion& a, const Motion& b, double rotation_rad, double direction_rad);

}  // namespace romap::slam
