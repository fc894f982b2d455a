#pragma once

#include <span>
#include <vector>

#include "server/slam/geometry/epipolar.h"
#include "server/slam/geometry/motion_search.h"

namespace romap::slam {

// All motions that could explain the matches, refined, best first, no two the same.
struct MotionRanking {
  std::vector<RefinedMotion> motions;
  std::vector<RayMatch> matches;  // with the noise estimated from them, where that is less than given

  // The support of the best motion that is not near the first; 0: none.
  double RivalSupport() const;
};

// Refines what RANSAC found, the motions of its homography, and starts in all directions about the best: errors of two
// views have several minima (forward and sideways motion, the two solutions of a plane), and a missed one may give a
// wrong map.
MotionRanking RankMotions(const CameraModel& camera, const MotionSearch& search, std::span<const RayMatch> matches);

}  // namespace romap::slam
