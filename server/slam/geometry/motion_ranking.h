#pragma once

#include <span>
#include <vector>

#include "server/slam/geometry/epipolar.h"
#include "server/slam/geometry/motion_search.h"

namespace romap::slam {

// All motions that could explain the matches, refined, best first, no two the same.
struct MotionRanking {
  std::vector<RefinedMotion> motions;
  std::vector<RayMatch> matches;  // with the noise that they show, where that is less than they claimed

  // The support of the best motion that is not near the first; 0: none.
  double RivalSupport() const;
};

// Refines what RANSAC found, the motions of its homography, and starts in all directions about the best: errors of two
// views have several minima (forwards and sideways, a plane and its twin), and a rival that nobody looked for is how
// wrong maps begin.
MotionRanking RankMotions(const CameraModel& camera, const MotionSearch& search, std::span<const RayMatch> matches);

}  // namespace romap::slam
