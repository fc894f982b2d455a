#pragma once

#include <span>
#include <vector>

#include "server/slam/geometry/epipolar.h"
#include "server/slam/geometry/motion_search.h"

namespace romap::slam {

// The candidate motions for a set of matches: refined, without duplicates, best first.
struct MotionRanking {
  std::vector<RefinedMotion> motions;
  std::vector<RayMatch> matches;  // with sigma_px reduced if they scatter less than given

  // Support of the best motion that clearly differs from the first one; 0 if there is none.
  double SecondBestSupport() const;
};

// Refines the motions found by RANSAC, the motions of its homography, and motions in all directions with the best
// rotation. The error of two views has several minima (forward and sideways motion, the two solutions of a plane), and
// missing one can result in a wrong map.
MotionRanking RankMotions(const CameraModel& camera, const MotionSearch& search, std::span<const RayMatch> matches);

}  // namespace romap::slam
