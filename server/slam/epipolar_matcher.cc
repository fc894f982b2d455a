#include "server/slam/epipolar_matcher.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace romap::slam {
namespace {

constexpr double kSigmas = 2.5;              // width of the search band on either side of the epipolar plane
constexpr double kMaxParallax_rad = 0.8;     // ORB descriptors differ too much at larger angles
constexpr double kMinSineToBaseline = 0.05;  // rays closer to the baseline do not determine depth
constexpr int kMaxOctaveDifference = 2;
constexpr float kSameSpot_px = 4;  // per octave scale: a second candidate closer than this is the same corner

// A ray in the polar coordinates of a pair of keyframes.
struct EpipolarRay {
  int feature = 0;
  double around_rad = 0;         // angle around the baseline: selects the epipolar plane
  double from_baseline_rad = 0;  // angle with the baseline: position in that plane
  double around_sigma_rad = 0;
};

struct Best {
  int feature = -1;
  int distance = std::numeric_limits<int>::max();
  int second_distance = std::numeric_limits<int>::max();
};

std::vector<EpipolarRay> PolarRays(const MapKeyframe& keyframe, const Eigen::Matrix3d& axes, bool only_new,
                                   const SlamConfig& config) {
  std::vector<EpipolarRay> rays;
  for (size_t i = 0; i < keyframe.features().size(); ++i) {
    if (only_new && keyframe.points[i]) continue;
    const Eigen::Vector3d ray = axes.transpose() * keyframe.BearingWorld(i);
    const double sine = ray.head<2>().norm();
    if (sine < kMinSineToBaseline) continue;
    const double sigma_rad = config.pixel_sigma_px * keyframe.features()[i].octave_scale / keyframe.camera().fx_px;
    rays.push_back({static_cast<int>(i), std::atan2(ray.y(), ray.x()), std::atan2(sine, ray.z()), sigma_rad / sine});
  }
  return rays;
}

// Columns: two axes perpendicular to the baseline, then the baseline itself.
Eigen::Matrix3d BaselineAxes(const Eigen::Vector3d& baseline) {
  Eigen::Matrix3d axes;
  axes.col(2) = baseline.normalized();
  axes.col(0) = axes.col(2).unitOrthogonal();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

void Offer(const MapKeyframe& keyframe, int feature, int distance, Best& best) {
  const auto same_spot = [&](int a, int b) {
    const Feature& fa = keyframe.features()[static_cast<size_t>(a)];
    const Feature& fb = keyframe.features()[static_cast<size_t>(b)];
    const auto scale = static_cast<float>(std::max(fa.octave_scale, fb.octave_scale));
    return (fa.pixel_px - fb.pixel_px).norm() < kSameSpot_px * scale;
  };
  const bool is_rival = best.feature >= 0 && !same_spot(best.feature, feature);
  if (distance < best.distance) {
    if (is_rival) best.second_distance = best.distance;
    best.distance = distance;
    best.feature = feature;
  } else if (is_rival) {
    best.second_distance = std::min(best.second_distance, distance);
  }
}

// Calls `visit` for each ray of `sorted` (by around_rad) in the epipolar plane of `ray`, within the uncertainty of
// both.
template <class Visit>
void VisitPlane(const EpipolarRay& ray, const std::vector<EpipolarRay>& sorted, double max_sigma_rad, Visit visit) {
  const double reach_rad = kSigmas * (ray.around_sigma_rad + max_sigma_rad);
  for (const double turn_rad : {-2 * std::numbers::pi, 0.0, 2 * std::numbers::pi}) {
    const double around_rad = ray.around_rad + turn_rad;
    auto it = std::lower_bound(sorted.begin(), sorted.end(), around_rad - reach_rad,
                               [](const EpipolarRay& r, double value) { return r.around_rad < value; });
    for (; it != sorted.end() && it->around_rad <= around_rad + reach_rad; ++it) {
      const double gap_rad = it->around_rad - around_rad;
      const double variance = ray.around_sigma_rad * ray.around_sigma_rad + it->around_sigma_rad * it->around_sigma_rad;
      if (gap_rad * gap_rad <= kSigmas * kSigmas * variance) visit(*it);
    }
  }
}

}  // namespace

std::vector<FeatureMatch> MatchAlongEpipolarPlanes(const MapKeyframe& first, const MapKeyframe& second,
                                                   const SlamConfig& config) {
  const Eigen::Vector3d baseline = second.center_world() - first.center_world();
  if (!(baseline.norm() > 0)) return {};
  const Eigen::Matrix3d axes = BaselineAxes(baseline);
  const std::vector<EpipolarRay> first_rays = PolarRays(first, axes, true, config);
  std::vector<EpipolarRay> second_rays = PolarRays(second, axes, false, config);
  std::sort(second_rays.begin(), second_rays.end(), [](const EpipolarRay& a, const EpipolarRay& b) {
    return std::pair(a.around_rad, a.feature) < std::pair(b.around_rad, b.feature);
  });
  double max_sigma_rad = 0;
  for (const EpipolarRay& ray : second_rays) max_sigma_rad = std::max(max_sigma_rad, ray.around_sigma_rad);

  const double min_parallax_rad = config.min_parallax_deg * std::numbers::pi / 180;
  std::vector<Best> best_of_first(first.features().size());
  std::vector<Best> best_of_second(second.features().size());
  for (const EpipolarRay& ray : first_rays) {
    const Feature& feature = first.features()[static_cast<size_t>(ray.feature)];
    VisitPlane(ray, second_rays, max_sigma_rad, [&](const EpipolarRay& candidate) {
      const Feature& other = second.features()[static_cast<size_t>(candidate.feature)];
      const double parallax_rad = candidate.from_baseline_rad - ray.from_baseline_rad;
      if (parallax_rad < min_parallax_rad || parallax_rad > kMaxParallax_rad) return;
      if (std::abs(feature.octave - other.octave) > kMaxOctaveDifference) return;
      const int distance = HammingDistance(feature.descriptor, other.descriptor);
      Offer(second, candidate.feature, distance, best_of_first[static_cast<size_t>(ray.feature)]);
      Offer(first, ray.feature, distance, best_of_second[static_cast<size_t>(candidate.feature)]);
    });
  }

  std::vector<FeatureMatch> matches;
  for (size_t i = 0; i < best_of_first.size(); ++i) {
    const Best& best = best_of_first[i];
    if (best.feature < 0 || best.distance > kMaxMatchDistance_bits) continue;
    const Best& back = best_of_second[static_cast<size_t>(best.feature)];
    if (back.feature != static_cast<int>(i)) continue;
    if (best.distance >= kMaxMatchRatio * best.second_distance ||
        back.distance >= kMaxMatchRatio * back.second_distance)
      continue;
    matches.push_back({static_cast<int>(i), best.feature, best.distance});
  }
  return matches;
}

}  // namespace romap::slam
