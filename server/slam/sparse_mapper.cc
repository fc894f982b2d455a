#include "server/slam/sparse_mapper.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <tuple>
#include <unordered_set>
#include <utility>

#include "server/slam/epipolar_matcher.h"
#include "server/slam/triangulation.h"

namespace romap {
namespace {

constexpr double kMaxAxisTurnCosine = 0.77;  // 40 degrees between two cameras that are matched
constexpr double kMaxSizeRatio = 1.9;        // between the sizes that two features of one point claim to have

}  // namespace

KeyframeView SparseMapper::AddKeyframe(const TrackedFrame& tracked) {
  const Frame& frame = *tracked.frame;
  MapKeyframe keyframe =
      MakeMapKeyframe(KeyframeId{++keyframe_count_}, frame, tracked.T_world_camera, extractor_.Extract(frame));
  FindKnownPoints(keyframe);
  MakePointsByParallax(keyframe);
  MakePointsByDepth(keyframe);

  kept_keyframes_.push_back(std::move(keyframe));
  if (kept_keyframes_.size() > static_cast<size_t>(config_.kept_keyframes)) kept_keyframes_.pop_front();
  std::vector<MapPointId> removed = Cull();
  KeyframeView view = MakeView(tracked, kept_keyframes_.back());
  view.removed_points = std::move(removed);
  return view;
}

void SparseMapper::FindKnownPoints(MapKeyframe& keyframe) {
  using Claim = std::tuple<int, MapPointId, int>;  // distance, point, feature: the best come first
  std::vector<Claim> claims;
  for (const auto& [id, track] : tracks_) {
    const auto found = FindInKeyframe(track, keyframe, config_);
    if (found) claims.emplace_back(found->distance, id, found->feature);
  }
  std::sort(claims.begin(), claims.end());
  for (const auto& [distance, id, feature] : claims) {
    Tie(keyframe, feature, tracks_.at(id));
  }
}

void SparseMapper::MakePointsByParallax(MapKeyframe& keyframe) {
  const std::vector<MapKeyframe*> others = KeyframesToMatch(keyframe);
  for (MapKeyframe* other : others) {
    for (const FeatureMatch& match : MatchAlongEpipolarPlanes(keyframe, *other, config_)) {
      if (const MapPointId known = other->points[static_cast<size_t>(match.second)]) {
        Tie(keyframe, match.first, tracks_.at(known));
        continue;
      }
      PointTrack* track = MakePoint(keyframe, match.first, *other, match.second);
      if (track == nullptr) continue;
      for (MapKeyframe* third : others) {
        if (third == other) continue;
        if (const auto found = FindInKeyframe(*track, *third, config_)) Tie(*third, found->feature, *track);
      }
    }
  }
}

void SparseMapper::MakePointsByDepth(MapKeyframe& keyframe) {
  for (size_t i = 0; i < keyframe.features.size(); ++i) {
    const double range_mu = keyframe.ranges_mu[i];
    if (keyframe.points[i] || range_mu <= 0) continue;
    NewTrack(keyframe, static_cast<int>(i), keyframe.center_world() + range_mu * keyframe.bearings_world[i]);
  }
}

std::vector<MapKeyframe*> SparseMapper::KeyframesToMatch(const MapKeyframe& keyframe) {
  std::vector<double> depths_mu;
  for (const MapPointId id : keyframe.points) {
    if (id) depths_mu.push_back((keyframe.T_camera_world * tracks_.at(id).point.position_world).z());
  }
  double min_baseline_mu = 0;
  if (!depths_mu.empty()) {
    const auto middle = depths_mu.begin() + static_cast<std::ptrdiff_t>(depths_mu.size() / 2);
    std::nth_element(depths_mu.begin(), middle, depths_mu.end());
    min_baseline_mu = *middle * std::tan(config_.min_parallax_deg * std::numbers::pi / 180);
  }
  const Eigen::Vector3d axis = keyframe.T_world_camera.rotation() * Eigen::Vector3d::UnitZ();
  std::vector<MapKeyframe*> others;
  for (auto it = kept_keyframes_.rbegin(); it != kept_keyframes_.rend(); ++it) {
    if (others.size() == static_cast<size_t>(config_.matched_keyframes)) break;
    if ((it->center_world() - keyframe.center_world()).norm() <= min_baseline_mu) continue;
    const Eigen::Vector3d other_axis = it->T_world_camera.rotation() * Eigen::Vector3d::UnitZ();
    if (axis.dot(other_axis) > kMaxAxisTurnCosine) others.push_back(&*it);
  }
  return others;
}

PointTrack* SparseMapper::MakePoint(MapKeyframe& keyframe, int feature, MapKeyframe& other, int other_feature) {
  const Sight sight = SightOf(keyframe, feature, config_);
  const Sight other_sight = SightOf(other, other_feature, config_);
  const std::optional<Eigen::Vector3d> start = IntersectRays(sight, other_sight);
  if (!start) return nullptr;
  const Eigen::Vector3d p_world = RefinePoint({sight, other_sight}, *start);
  if (!Agrees(sight, p_world) || !Agrees(other_sight, p_world)) return nullptr;
  if (Parallax_rad(sight, other_sight, p_world) < config_.min_parallax_deg * std::numbers::pi / 180) return nullptr;
  const double size_mu = sight.bearing_sigma_rad * (p_world - sight.center_world).norm();
  const double other_size_mu = other_sight.bearing_sigma_rad * (p_world - other_sight.center_world).norm();
  if (std::max(size_mu, other_size_mu) > kMaxSizeRatio * std::min(size_mu, other_size_mu)) return nullptr;

  PointTrack& track = NewTrack(other, other_feature, p_world);
  if (Tie(keyframe, feature, track)) return &track;
  other.points[static_cast<size_t>(other_feature)] = {};
  tracks_.erase(track.point.id);
  return nullptr;
}

PointTrack& SparseMapper::NewTrack(MapKeyframe& keyframe, int feature, const Eigen::Vector3d& p_world) {
  const MapPointId id{++point_count_};
  keyframe.points[static_cast<size_t>(feature)] = id;
  PointTrack& track = tracks_.emplace(id, StartTrack(id, keyframe, feature, p_world, config_)).first->second;
  track.born_keyframe = keyframe_count_;
  return track;
}

// A point is seen at most once in a keyframe, and a feature shows at most one point.
bool SparseMapper::Tie(MapKeyframe& keyframe, int feature, PointTrack& track) {
  MapPointId& tied = keyframe.points[static_cast<size_t>(feature)];
  if (tied || track.latest_keyframe == keyframe.id.value || !AddSight(keyframe, feature, config_, track)) return false;
  tied = track.point.id;
  return true;
}

std::vector<MapPointId> SparseMapper::Cull() {
  std::vector<MapPointId> gone;
  std::vector<std::pair<uint64_t, MapPointId>> by_age;
  for (const auto& [id, track] : tracks_) {
    const bool trial_is_over = keyframe_count_ - track.born_keyframe >= static_cast<uint64_t>(config_.trial_keyframes);
    if (trial_is_over && track.point.observations < config_.trial_observations) {
      gone.push_back(id);
    } else {
      by_age.emplace_back(track.latest_keyframe, id);
    }
  }
  if (by_age.size() > static_cast<size_t>(config_.max_points)) {
    std::sort(by_age.begin(), by_age.end());
    by_age.resize(by_age.size() - static_cast<size_t>(config_.max_points));
    for (const auto& [latest_keyframe, id] : by_age) gone.push_back(id);
  }
  for (const MapPointId id : gone) tracks_.erase(id);
  const std::unordered_set<MapPointId> gone_set(gone.begin(), gone.end());
  for (MapKeyframe& keyframe : kept_keyframes_) {
    for (MapPointId& point : keyframe.points) {
      if (point && gone_set.contains(point)) point = {};
    }
  }
  return gone;
}

KeyframeView SparseMapper::MakeView(const TrackedFrame& tracked, const MapKeyframe& keyframe) const {
  KeyframeView view;
  view.id = keyframe.id;
  view.frame = tracked.frame;
  view.T_world_camera = tracked.T_world_camera;
  view.up_world = tracked.up_world;
  for (size_t i = 0; i < keyframe.features.size(); ++i) {
    if (!keyframe.points[i]) continue;
    const Feature& feature = keyframe.features[i];
    view.observations.push_back({.point = keyframe.points[i], .pixel_px = feature.pixel_px, .label = feature.label});
    view.points.push_back(tracks_.at(keyframe.points[i]).point);
  }
  return view;
}

}  // namespace romap
