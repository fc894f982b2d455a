#include "server/slam/point_maker.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include "common/angles.h"
#include "common/statistics.h"
#include "server/slam/epipolar_matcher.h"
#include "server/slam/projection_search.h"
#include "server/slam/triangulation.h"

namespace romap::slam {
namespace {

constexpr double kMaxAxisTurnCosine = 0.77;  // 40 degrees between two cameras that are matched
constexpr double kMaxPointSizeRatio = 1.9;   // between the sizes of a point according to two features
constexpr double kSearchRadius_px = 4;       // around the projection of a known point
constexpr double kFuseRadius_px = 2.5;
constexpr int kFuseDistance = 50;  // Hamming, bits

std::vector<uint8_t> ObservedFeatures(const MapKeyframe& keyframe) {
  std::vector<uint8_t> observed(keyframe.points.size());
  std::transform(keyframe.points.begin(), keyframe.points.end(), observed.begin(),
                 [](MapPointId point) { return static_cast<uint8_t>(point ? 1 : 0); });
  return observed;
}

}  // namespace

LocalPoint MakeLocalPoint(const PointTrack& track) {
  return {.id = track.point.id,
          .position_world = track.point.position_world,
          .direction_world = track.direction_world,
          .size_mu = track.size_mu,
          .descriptor = track.descriptor,
          .patch = track.patch};
}

SlamConfig PointMaker::RelaxedConfig(SlamConfig config) {
  config.matched_keyframes *= 2;
  config.min_parallax_deg *= 0.6;
  return config;
}

bool PointMaker::Associate(MapKeyframe& keyframe, int feature, PointTrack& track) {
  if (keyframe.points[static_cast<size_t>(feature)]) return false;
  const ObservedRay ray = map_->RayOf(keyframe, feature);
  if (!keyframe.pose_given) {
    if (!Agrees(ray, track.point.position_world)) return false;
    return map_->AddObservation(track, keyframe, feature);
  }
  std::vector<ObservedRay> rays = map_->RaysOf(track);
  rays.push_back(ray);
  const Eigen::Vector3d p_world = RefinePoint(rays, track.point.position_world);
  if (!std::all_of(rays.begin(), rays.end(), [&](const ObservedRay& r) { return Agrees(r, p_world); })) return false;
  if (!map_->AddObservation(track, keyframe, feature)) return false;
  track.point.position_world = p_world;
  return true;
}

void PointMaker::FindKnownPoints(MapKeyframe& keyframe, const std::vector<MapPointId>& candidates) {
  using Candidate = std::tuple<int, MapPointId, int>;  // distance, point, feature: the best come first
  std::vector<Candidate> found_features;
  ProjectionMatcher matcher(*keyframe.frame, keyframe.T_world_camera());
  const ProjectionSearch search{.radius_px = kSearchRadius_px, .max_distance = kMaxMatchDistance_bits};
  const std::vector<uint8_t> observed = ObservedFeatures(keyframe);
  for (const MapPointId id : candidates) {
    const PointTrack* track = map_->FindPoint(id);
    if (track == nullptr) continue;
    if (const auto found = matcher.Find(MakeLocalPoint(*track), search, observed)) {
      found_features.emplace_back(found->distance, track->point.id, found->feature);
    }
  }
  std::sort(found_features.begin(), found_features.end());
  for (const auto& [distance, id, feature] : found_features) Associate(keyframe, feature, *map_->FindPoint(id));
}

std::optional<int> PointMaker::FindFreeFeature(const PointTrack& track, const MapKeyframe& keyframe) const {
  ProjectionMatcher matcher(*keyframe.frame, keyframe.T_world_camera());
  const ProjectionSearch search{.radius_px = kSearchRadius_px, .max_distance = kMaxMatchDistance_bits};
  const auto found = matcher.Find(MakeLocalPoint(track), search, {});
  if (!found || keyframe.points[static_cast<size_t>(found->feature)]) return std::nullopt;
  return found->feature;
}

void PointMaker::MakePointsByParallax(MapKeyframe& keyframe, const std::vector<MapKeyframe*>& others) {
  for (MapKeyframe* other : others) {
    for (const FeatureMatch& match : MatchAlongEpipolarPlanes(keyframe, *other, config_)) {
      if (const MapPointId known = other->points[static_cast<size_t>(match.second)]) {
        Associate(keyframe, match.first, *map_->FindPoint(known));
        continue;
      }
      PointTrack* track = MakePoint(keyframe, match.first, *other, match.second);
      if (track == nullptr) continue;
      for (MapKeyframe* third : others) {
        if (third == other) continue;
        if (const auto feature = FindFreeFeature(*track, *third)) Associate(*third, *feature, *track);
      }
    }
  }
}

PointTrack* PointMaker::MakePoint(MapKeyframe& keyframe, int feature, MapKeyframe& other, int other_feature) {
  if (keyframe.points[static_cast<size_t>(feature)]) return nullptr;
  const ObservedRay ray = map_->RayOf(keyframe, feature);
  const ObservedRay other_ray = map_->RayOf(other, other_feature);
  const std::optional<Eigen::Vector3d> start = IntersectRays(ray, other_ray);
  if (!start) return nullptr;
  const Eigen::Vector3d p_world = RefinePoint({ray, other_ray}, *start);
  if (!Agrees(ray, p_world) || !Agrees(other_ray, p_world)) return nullptr;
  if (Parallax_rad(ray, other_ray, p_world) < config_.min_parallax_deg * kRadPerDeg) return nullptr;
  const double size_mu = ray.bearing_sigma_rad * (p_world - ray.center_world).norm();
  const double other_size_mu = other_ray.bearing_sigma_rad * (p_world - other_ray.center_world).norm();
  if (std::max(size_mu, other_size_mu) > kMaxPointSizeRatio * std::min(size_mu, other_size_mu)) return nullptr;

  PointTrack& track = map_->AddPoint(p_world);
  map_->AddObservation(track, other, other_feature);
  map_->AddObservation(track, keyframe, feature);
  map_->Refresh(track);
  return &track;
}

void PointMaker::MakePointsByDepth(MapKeyframe& keyframe) {
  for (size_t i = 0; i < keyframe.points.size(); ++i) {
    const double range_mu = keyframe.frame->ranges_mu[i];
    if (keyframe.points[i] || range_mu <= 0) continue;
    PointTrack& track = map_->AddPoint(keyframe.center_world() + range_mu * keyframe.BearingWorld(i));
    map_->AddObservation(track, keyframe, static_cast<int>(i));
    map_->Refresh(track);
  }
}

std::vector<MapKeyframe*> PointMaker::KeyframesToMatch(const MapKeyframe& keyframe) const {
  const double min_baseline_mu =
      map_->MedianDepth_mu(keyframe).value_or(0) * std::tan(config_.min_parallax_deg * kRadPerDeg);
  const Eigen::Vector3d axis = keyframe.T_world_camera().rotation() * Eigen::Vector3d::UnitZ();
  // Keyframes that share points, and the newest ones, which may not share any yet.
  std::vector<KeyframeId> candidates;
  for (const auto& [id, shared] : map_->Covisible(keyframe, kMinSharedPoints)) candidates.push_back(id);
  for (auto it = map_->keyframes().rbegin(); it != map_->keyframes().rend() && candidates.size() < 60; ++it) {
    if (it->first != keyframe.id && std::find(candidates.begin(), candidates.end(), it->first) == candidates.end()) {
      if (keyframe.pose_given || candidates.empty()) candidates.push_back(it->first);
    }
  }
  // With given poses all are equally accurate, and those nearest in time have the most similar views.
  if (keyframe.pose_given) std::sort(candidates.rbegin(), candidates.rend());
  std::vector<MapKeyframe*> others;
  for (const KeyframeId id : candidates) {
    if (others.size() == static_cast<size_t>(config_.matched_keyframes)) break;
    MapKeyframe* other = map_->FindKeyframe(id);
    if ((other->center_world() - keyframe.center_world()).norm() <= min_baseline_mu) continue;
    const Eigen::Vector3d other_axis = other->T_world_camera().rotation() * Eigen::Vector3d::UnitZ();
    if (axis.dot(other_axis) > kMaxAxisTurnCosine) others.push_back(other);
  }
  return others;
}

void PointMaker::FuseInto(MapKeyframe& keyframe, const std::vector<MapPointId>& points) {
  ProjectionMatcher matcher(*keyframe.frame, keyframe.T_world_camera());
  const ProjectionSearch search{.radius_px = kFuseRadius_px, .max_distance = kFuseDistance};
  for (const MapPointId id : points) {
    PointTrack* track = map_->FindPoint(id);
    if (track == nullptr) continue;
    if (track->IsObservedBy(keyframe.id)) continue;
    const auto found = matcher.Find(MakeLocalPoint(*track), search, {});
    if (!found) continue;
    const MapPointId there = keyframe.points[static_cast<size_t>(found->feature)];
    if (!there) {
      Associate(keyframe, found->feature, *track);
      continue;
    }
    // Keep the point with more observations.
    const PointTrack* other = map_->FindPoint(there);
    const bool keep_other = other->observations.size() >= track->observations.size();
    map_->MergePoints(keep_other ? track->point.id : there, keep_other ? there : track->point.id);
  }
}

void PointMaker::FuseDuplicates(MapKeyframe& keyframe, const std::vector<MapKeyframe*>& neighbors) {
  const auto points_of = [](const MapKeyframe& of) {
    std::vector<MapPointId> points;
    std::copy_if(of.points.begin(), of.points.end(), std::back_inserter(points),
                 [](MapPointId id) { return bool(id); });
    return points;
  };
  for (MapKeyframe* neighbor : neighbors) {
    FuseInto(*neighbor, points_of(keyframe));
    FuseInto(keyframe, points_of(*neighbor));
  }
}

}  // namespace romap::slam
