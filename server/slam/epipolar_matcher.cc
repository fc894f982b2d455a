#include "server/slam/epipolar_matcher.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "common/angles.h"

namespace romap::slam {
namespace {

constexpr double kSigmas = 2.5;           // maximum distance of a ray from the epipolar plane, in standard deviations
constexpr double kMaxParallax_rad = 0.8;  // ORB descriptors differ too much at larger angles
constexpr double kMinSineToBaseline = 0.05;  // rays closer to the baseline do not determine depth
constexpr int kMaxOctaveDifference = 2;
constexpr float kSameEpipolarCorner_px = 4;  // per octave scale: a second candidate closer than this is the same corner

// A ray in polar coordinates whose axis is the baseline of a pair of keyframes.
struct EpipolarRay {
  int feature = 0;
  double azimuth_rad = 0;  // angle around the baseline: selects the epipolar plane
  double polar_rad = 0;    // angle with the baseline: position in that plane
  double azimuth_sigma_rad = 0;
};

struct BestFeature {
  int feature = -1;
  int distance = std::numeric_limits<int>::max();
  int second_distance = std::numeric_limits<int>::max();
};

std::vector<EpipolarRay> ToEpipolarRays(const MapKeyframe& keyframe, const Eigen::Matrix3d& axes,
                                        bool skip_features_with_point, const SlamConfig& config) {
  std::vector<EpipolarRay> rays;
  for (size_t i = 0; i < keyframe.features().size(); ++i) {
    if (skip_features_with_point && keyframe.points[i]) continue;
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

void UpdateBest(const MapKeyframe& keyframe, int feature, int distance, BestFeature& best) {
  const auto is_same_corner = [&](int a, int b) {
    const Feature& fa = keyframe.features()[static_cast<size_t>(a)];
    const Feature& fb = keyframe.features()[static_cast<size_t>(b)];
    const auto scale = static_cast<float>(std::max(fa.octave_scale, fb.octave_scale));
    return (fa.pixel_px - fb.pixel_px).norm() < kSameEpipolarCorner_px * scale;
  };
  const bool is_other_corner = best.feature >= 0 && !is_same_corner(best.feature, feature);
  if (distance < best.distance) {
    if (is_other_corner) best.second_distance = best.distance;
    best.distance = distance;
    best.feature = feature;
  } else if (is_other_corner) {
    best.second_distance = std::min(best.second_distance, distance);
  }
}

// Calls `visit` for each ray of `sorted` (by azimuth_rad) that is in the epipolar plane of `ray` to within the
// uncertainty of both.
template <class Visit>
void VisitEpipolarPlane(const EpipolarRay& ray, const std::vector<EpipolarRay>& sorted, double max_azimuth_sigma_rad,
                        Visit visit) {
  const double max_gap_rad = kSigmas * (ray.azimuth_sigma_rad + max_azimuth_sigma_rad);
  for (const double wrap_rad : {-2 * std::numbers::pi, 0.0, 2 * std::numbers::pi}) {
    const double azimuth_rad = ray.azimuth_rad + wrap_rad;
    auto it = std::lower_bound(sorted.begin(), sorted.end(), azimuth_rad - max_gap_rad,
                               [](const EpipolarRay& r, double value) { return r.azimuth_rad < value; });
    for (; it != sorted.end() && it->azimuth_rad <= azimuth_rad + max_gap_rad; ++it) {
      const double gap_rad = it->azimuth_rad - azimuth_rad;
      const double variance =
          ray.azimuth_sigma_rad * ray.azimuth_sigma_rad + it->azimuth_sigma_rad * it->azimuth_sigma_rad;
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
  const std::vector<EpipolarRay> first_rays = ToEpipolarRays(first, axes, true, config);
  std::vector<EpipolarRay> second_rays = ToEpipolarRays(second, axes, false, config);
  std::sort(second_rays.begin(), second_rays.end(), [](const EpipolarRay& a, const EpipolarRay& b) {
    return std::pair(a.azimuth_rad, a.feature) < std::pair(b.azimuth_rad, b.feature);
  });
  double max_azimuth_sigma_rad = 0;
  for (const EpipolarRay& ray : second_rays)
    max_azimuth_sigma_rad = std::max(max_azimuth_sigma_rad, ray.azimuth_sigma_rad);

  const double min_parallax_rad = config.min_parallax_deg * kRadPerDeg;
  std::vector<BestFeature> best_of_first(first.features().size());
  std::vector<BestFeature> best_of_second(second.features().size());
  for (const EpipolarRay& ray : first_rays) {
    const Feature& feature = first.features()[static_cast<size_t>(ray.feature)];
    VisitEpipolarPlane(ray, second_rays, max_azimuth_sigma_rad, [&](const EpipolarRay& candidate) {
      const Feature& other = second.features()[static_cast<size_t>(candidate.feature)];
      const double parallax_rad = candidate.polar_rad - ray.polar_rad;
      if (parallax_rad < min_parallax_rad || parallax_rad > kMaxParallax_rad) return;
      if (std::abs(feature.octave - other.octave) > kMaxOctaveDifference) return;
      const int distance = HammingDistance(feature.descriptor, other.descriptor);
      UpdateBest(second, candidate.feature, distance, best_of_first[static_cast<size_t>(ray.feature)]);
      UpdateBest(first, ray.feature, distance, best_of_second[static_cast<size_t>(candidate.feature)]);
    });
  }

  std::vector<FeatureMatch> matches;
  for (size_t i = 0; i < best_of_first.size(); ++i) {
    const BestFeature& best = best_of_first[i];
    if (best.feature < 0 || best.distance > kMaxMatchDistance_bits) continue;
    const BestFeature& back = best_of_second[static_cast<size_t>(best.feature)];
    if (back.feature != static_cast<int>(i)) continue;
    if (best.distance >= kMaxMatchRatio * best.second_distance ||
        back.distance >= kMaxMatchRatio * back.second_distance)
      continue;
    matches.push_back({static_cast<int>(i), best.feature, best.distance});
  }
  return matches;
}

}  // namespace romap::slam
