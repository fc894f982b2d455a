#include "server/slam/map_culling.h"

#include <algorithm>
#include <utility>

namespace romap::slam {
namespace {

// A new point is removed unless it has kTrialObservations observations after kTrialKeyframes further keyframes.
constexpr uint64_t kTrialKeyframes = 3;
constexpr int kTrialObservations = 3;
constexpr double kRedundantShare = 0.97;
constexpr int kMinOtherKeyframes = 3;
constexpr size_t kMaxRemoved = 2;  // per call, so that bundle adjustment can compensate

bool IsRedundant(const MapKeyframe& keyframe, const SlamMap& map) {
  int points = 0;
  int redundant = 0;
  for (size_t i = 0; i < keyframe.points.size(); ++i) {
    if (!keyframe.points[i]) continue;
    ++points;
    int as_good = 0;
    for (const FeatureRef& observation : map.FindPoint(keyframe.points[i])->observations) {
      if (observation.keyframe == keyframe.id) continue;
      const auto& features = map.FindKeyframe(observation.keyframe)->features();
      as_good += features[static_cast<size_t>(observation.feature)].octave <= keyframe.features()[i].octave + 1 ? 1 : 0;
      if (as_good == kMinOtherKeyframes) break;
    }
    redundant += as_good == kMinOtherKeyframes ? 1 : 0;
  }
  return points > 0 && redundant > kRedundantShare * points;
}

}  // namespace

void CullPoints(const SlamConfig& config, SlamMap& map) {
  std::vector<MapPointId> removed;
  std::vector<std::pair<uint64_t, MapPointId>> by_age;
  for (const auto& [id, track] : map.points()) {
    const bool trial_is_over = map.keyframe_count() - track.created_keyframe >= kTrialKeyframes;
    if (trial_is_over && track.point.observations < kTrialObservations) {
      removed.push_back(id);
    } else {
      by_age.emplace_back(track.latest_keyframe, id);
    }
  }
  if (by_age.size() > static_cast<size_t>(config.max_points)) {
    std::sort(by_age.begin(), by_age.end());
    by_age.resize(by_age.size() - static_cast<size_t>(config.max_points));
    for (const auto& [latest_keyframe, id] : by_age) removed.push_back(id);
  }
  for (const MapPointId id : removed) map.RemovePoint(id);
}

std::vector<KeyframeId> CullKeyframes(const SlamConfig& config, const MapKeyframe& newest, SlamMap& map) {
  std::vector<KeyframeId> removed;
  const auto may_remove = [&](const MapKeyframe& keyframe) {
    // Tracking depends on the newest keyframes, and the first keyframe defines the world, as do given poses while
    // others are tracked.
    return (!keyframe.pose_given || newest.pose_given) && keyframe.parent && keyframe.loops.empty() &&
           keyframe.id.value + 5 < newest.id.value;
  };
  for (const auto& [id, shared] : map.Covisible(newest, kMinSharedPoints)) {
    if (removed.size() == kMaxRemoved) break;
    const MapKeyframe& keyframe = *map.FindKeyframe(id);
    if (may_remove(keyframe) && IsRedundant(keyframe, map)) {
      map.RemoveKeyframe(id);
      removed.push_back(id);
    }
  }
  if (map.keyframes().size() > static_cast<size_t>(config.max_keyframes)) {
    // The keyframe closest to its parent adds the least information.
    KeyframeId closest;
    double max_closeness = 0;
    for (const auto& [id, keyframe] : map.keyframes()) {
      if (!may_remove(keyframe)) continue;
      const double distance_mu = (keyframe.center_world() - map.FindKeyframe(keyframe.parent)->center_world()).norm();
      const double closeness = 1 / (1e-9 + distance_mu);
      if (closeness > max_closeness) {
        max_closeness = closeness;
        closest = id;
      }
    }
    if (closest) {
      map.RemoveKeyframe(closest);
      removed.push_back(closest);
    }
  }
  return removed;
}

}  // namespace romap::slam
