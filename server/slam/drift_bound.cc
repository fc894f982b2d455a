#include "server/slam/drift_bound.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "common/angles.h"

namespace romap::slam {
namespace {

constexpr double kDriftSigmas = 3;
// Standard deviations. The systematic part of the rotation is what a focal length that is wrong by 2 % causes.
constexpr double kRotationPerKeyframe_rad = 0.1 * kRadPerDeg;
constexpr double kRotationPerTurn = 0.02;
constexpr double kTranslationPerPath = 0.01;
constexpr double kLogScalePerKeyframe = 0.004;
constexpr double kLogScalePerTurn_rad = 0.01;

// From the keyframe to the root of the tree of parents.
std::vector<KeyframeId> PathToRoot(const SlamMap& map, KeyframeId id) {
  std::vector<KeyframeId> path;
  for (const MapKeyframe* keyframe = map.FindKeyframe(id); keyframe != nullptr;
       keyframe = map.FindKeyframe(keyframe->parent)) {
    path.push_back(keyframe->id);
  }
  return path;
}

std::vector<KeyframeId> PathBetween(const SlamMap& map, KeyframeId from, KeyframeId to) {
  std::vector<KeyframeId> up = PathToRoot(map, from);
  std::vector<KeyframeId> down = PathToRoot(map, to);
  KeyframeId common;
  while (!up.empty() && !down.empty() && up.back() == down.back()) {
    common = up.back();
    up.pop_back();
    down.pop_back();
  }
  if (common) up.push_back(common);
  up.insert(up.end(), down.rbegin(), down.rend());
  return up;
}

}  // namespace

DriftBound DriftBetween(const SlamMap& map, KeyframeId from, KeyframeId to, bool scale_is_known) {
  DriftBound bound;
  const std::vector<KeyframeId> path = PathBetween(map, from, to);
  Eigen::AlignedBox3d extent_world;
  for (size_t i = 0; i < path.size(); ++i) {
    const MapKeyframe& keyframe = *map.FindKeyframe(path[i]);
    extent_world.extend(keyframe.center_world());
    if (i == 0) continue;
    const MapKeyframe& previous = *map.FindKeyframe(path[i - 1]);
    bound.path_mu += (keyframe.center_world() - previous.center_world()).norm();
    bound.turn_rad += keyframe.T_world_camera().rotation().angularDistance(previous.T_world_camera().rotation());
  }
  bound.path_keyframes = static_cast<int>(path.size());
  const double random = std::sqrt(static_cast<double>(path.size()));
  bound.rotation_rad = kDriftSigmas * std::hypot(random * kRotationPerKeyframe_rad, kRotationPerTurn * bound.turn_rad);
  if (!scale_is_known) {
    bound.log_scale = kDriftSigmas * std::hypot(random * kLogScalePerKeyframe, kLogScalePerTurn_rad * bound.turn_rad);
  }
  // A rotation error grows along the path: on average, half of it acts over the path's extent.
  const double extent_mu = path.empty() ? 0 : extent_world.diagonal().norm();
  bound.translation_mu = std::hypot(kDriftSigmas * kTranslationPerPath * bound.path_mu,
                                    0.5 * extent_mu * bound.rotation_rad, 0.5 * extent_mu * bound.log_scale);
  return bound;
}

bool IsWithin(const DriftBound& bound, const Sim3<World, World>& S_new_old, const MapKeyframe& keyframe) {
  const double rotation_rad = Eigen::AngleAxisd(S_new_old.rotation()).angle();
  const double distance_mu = (S_new_old * keyframe.center_world() - keyframe.center_world()).norm();
  return rotation_rad <= bound.rotation_rad && distance_mu <= bound.translation_mu &&
         std::abs(std::log(S_new_old.scale())) <= std::max(bound.log_scale, 1e-6);
}

}  // namespace romap::slam
