#include "server/slam/geometry/two_view.h"

#include <algorithm>

#include "common/angles.h"
#include "common/statistics.h"
#include "server/slam/geometry/epipolar.h"
#include "server/slam/geometry/homography.h"
#include "server/slam/geometry/motion_ranking.h"
#include "server/slam/geometry/motion_search.h"

namespace romap::slam {
namespace {

// The scene counts as planar if the homography has more than this share of the support of both models (Mur-Artal et al.
// 2015).
constexpr double kPlanarShare = 0.45;

// Sets the points, their number and the parallax of `result`. Returns the number of matches that agree with the motion.
int Triangulate(const CameraModel& camera, const Motion& motion, std::span<const RayMatch> matches,
                TwoViewResult& result) {
  const Eigen::Matrix3d essential = motion.Essential();
  std::vector<double> parallaxes_rad;
  for (size_t i = 0; i < matches.size(); ++i) {
    if (!(SampsonChi2(camera, essential, matches[i]) < kEpipolarChi2Bound)) continue;
    const RayMatch corrected = ClosestEpipolarMatch(camera, essential, matches[i]);
    const RayIntersection intersection = Intersect(camera, motion, corrected);
    if (intersection.is_significant && !intersection.IsInFrontOfBoth()) continue;
    parallaxes_rad.push_back(intersection.parallax_rad);
    if (!intersection.is_significant) continue;
    result.points_first[i] = intersection.first_depth * corrected.first;
    ++result.points;
  }
  if (parallaxes_rad.empty()) return 0;
  result.parallax_rad = Median(parallaxes_rad);
  return static_cast<int>(parallaxes_rad.size());
}

// Support of a pure rotation.
double RotationSupport(const CameraModel& camera, const MotionSearch& search, std::span<const RayMatch> matches) {
  return search.homography ? TransferSupport(camera, FitRotation(camera, *search.homography, matches), matches) : 0;
}

}  // namespace

TwoViewResult SolveTwoView(const CameraModel& camera, std::span<const TwoViewMatch> matches,
                           const TwoViewOptions& options) {
  TwoViewResult result;
  result.points_first.resize(matches.size());
  if (static_cast<int>(matches.size()) < options.min_matches) return result;
  const std::vector<RayMatch> rays = ToRays(camera, matches);
  const MotionSearch search = SearchMotions(camera, rays, options.max_iterations, options.seed);
  const MotionRanking ranking = RankMotions(camera, search, rays);
  if (ranking.motions.empty()) return result;

  const RefinedMotion& best = ranking.motions.front();
  result.T_first_second = SE3<Camera, Camera>(best.motion.rotation, best.motion.direction).Inverse();
  result.from_homography =
      search.homography_support > kPlanarShare * (search.homography_support + search.essential_support);
  const int agreeing = Triangulate(camera, best.motion, ranking.matches, result);
  if (agreeing < options.min_points) return result;

  if (RotationSupport(camera, search, ranking.matches) > options.max_rotation_support_ratio * best.support ||
      result.points < options.min_points || result.parallax_rad < options.min_parallax_deg * kRadPerDeg ||
      best.rotation_sigma_rad > options.max_rotation_sigma_deg * kRadPerDeg ||
      best.direction_sigma_rad > options.max_direction_sigma_deg * kRadPerDeg) {
    result.outcome = TwoViewOutcome::kTooLittleParallax;
  } else if (ranking.SecondBestSupport() > options.max_second_best_ratio * best.support) {
    result.outcome = TwoViewOutcome::kAmbiguous;
  } else {
    result.outcome = TwoViewOutcome::kOk;
  }
  return result;
}

const char* Describe(TwoViewOutcome outcome) {
  switch (outcome) {
    case TwoViewOutcome::kOk:
      return "found";
    case TwoViewOutcome::kTooFewMatches:
      return "too few matches agree with one camera motion";
    case TwoViewOutcome::kTooLittleParallax:
      return "too little parallax: the camera did not move or only rotated";
    case TwoViewOutcome::kAmbiguous:
      return "two motions explain the matches about equally well";
  }
  return "unknown";
}

}  // namespace romap::slam
