#include "server/slam/geometry/motion_ranking.h"

#include <algorithm>
#include <cmath>

#include "common/angles.h"
#include "common/statistics.h"
#include "server/slam/geometry/homography.h"

namespace romap::slam {
namespace {

// Refined motions closer to each other than this are the same minimum.
constexpr double kSameRotation_rad = 0.02 * kRadPerDeg;
constexpr double kSameDirection_rad = 0.2 * kRadPerDeg;
// Motions closer to each other than this are the same solution.
constexpr double kNearRotation_rad = 1 * kRadPerDeg;
constexpr double kNearDirection_rad = 10 * kRadPerDeg;
constexpr double kMedianChi2 = 0.4549;   // of chi-square with one degree of freedom
constexpr double kMinNoiseRatio = 0.25;  // lower limit, as a share of the given noise

std::vector<RefinedMotion> RefineAll(const CameraModel& camera, std::span<const Motion> starts,
                                     std::span<const RayMatch> matches) {
  std::vector<RefinedMotion> refined;
  for (const Motion& start : starts) {
    const RefinedMotion candidate = RefineMotion(camera, start, matches);
    const bool is_known = std::any_of(refined.begin(), refined.end(), [&](const RefinedMotion& other) {
      return AreSimilar(other.motion, candidate.motion, kSameRotation_rad, kSameDirection_rad);
    });
    if (!is_known) refined.push_back(candidate);
  }
  std::stable_sort(refined.begin(), refined.end(),
                   [](const RefinedMotion& a, const RefinedMotion& b) { return a.support > b.support; });
  return refined;
}

// Ratio of the actual noise of the agreeing matches (from their median error) to their sigma_px. A sigma_px that is too
// large hides how much better one motion is than another. The ratio is at most 1, because matches with a larger scatter
// may be wrong.
double NoiseRatio(const CameraModel& camera, const Motion& motion, std::span<const RayMatch> matches) {
  const Eigen::Matrix3d essential = motion.Essential();
  std::vector<double> chi2s;
  for (const RayMatch& match : matches) {
    const double chi2 = SampsonChi2(camera, essential, match);
    if (chi2 < kEpipolarChi2Bound) chi2s.push_back(chi2);
  }
  if (chi2s.empty()) return 1;
  return std::clamp(std::sqrt(Median(std::move(chi2s)) / kMedianChi2), kMinNoiseRatio, 1.0);
}

// Adds starts along the axes and halfway between them. RefineMotion also tries the opposite directions.
void AddAllDirections(const Eigen::Matrix3d& rotation, std::vector<Motion>& starts) {
  static const Eigen::Vector3d kDirections[] = {{1, 0, 0}, {0, 1, 0},  {0, 0, 1}, {1, 1, 0}, {1, -1, 0},
                                                {1, 0, 1}, {1, 0, -1}, {0, 1, 1}, {0, 1, -1}};
  for (const Eigen::Vector3d& direction : kDirections) starts.push_back({rotation, direction.normalized()});
}

}  // namespace

double MotionRanking::SecondBestSupport() const {
  for (const RefinedMotion& other : motions) {
    if (!AreSimilar(motions.front().motion, other.motion, kNearRotation_rad, kNearDirection_rad)) return other.support;
  }
  return 0;
}

MotionRanking RankMotions(const CameraModel& camera, const MotionSearch& search, std::span<const RayMatch> matches) {
  MotionRanking ranking;
  ranking.matches.assign(matches.begin(), matches.end());
  std::vector<Motion> starts = search.motions;
  if (search.homography) {
    const std::vector<Motion> plane_motions = MotionsFromHomography(*search.homography);
    starts.insert(starts.end(), plane_motions.begin(), plane_motions.end());
  }
  ranking.motions = RefineAll(camera, starts, ranking.matches);
  if (ranking.motions.empty()) return ranking;

  const double noise = NoiseRatio(camera, ranking.motions.front().motion, matches);
  for (RayMatch& match : ranking.matches) match.sigma_px *= noise;
  starts.clear();
  for (const RefinedMotion& refined : ranking.motions) starts.push_back(refined.motion);
  AddAllDirections(ranking.motions.front().motion.rotation, starts);
  ranking.motions = RefineAll(camera, starts, ranking.matches);
  return ranking;
}

}  // namespace romap::slam
