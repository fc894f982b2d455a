#include "server/slam/loop_detector.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/angles.h"
#include "common/statistics.h"
#include "server/slam/drift_bound.h"
#include "server/slam/geometry/similarity.h"

namespace romap::slam {
namespace {

constexpr int kMaxLoopCandidates = 8;  // by descriptors, besides connected keyframes
constexpr int kTriedCandidates = 3;    // of those, verified geometrically
constexpr int kMinCommonPoints = 15;
constexpr uint64_t kMinLoopKeyframes = 10;  // between the old and the newest keyframe
// Another explanation with this share of the points makes a loop ambiguous.
constexpr double kLoopRivalShare = 0.6;
constexpr size_t kEarlierKeyframes = 6;     // before the newest, asked whether they observe the old place too
constexpr int kMinSupportingKeyframes = 2;  // of those
constexpr double kMaxDisagreement_px = 8;   // between the old points in an earlier keyframe and the correction

double MedianDistance_px(const MapKeyframe& keyframe, const SE3<World, Camera>& T_world_camera, const SlamMap& map,
                         const LocatedFrame& located) {
  const SE3<Camera, World> T_camera_world = T_world_camera.Inverse();
  std::vector<double> distances_px;
  for (const auto& [id, feature] : located.points) {
    const Eigen::Vector3d p_camera = T_camera_world * map.FindPoint(id)->point.position_world;
    const Eigen::Vector2d pixel_px = keyframe.features()[static_cast<size_t>(feature)].pixel_px.cast<double>();
    distances_px.push_back(p_camera.z() > 0 ? (keyframe.camera().Project(p_camera) - pixel_px).norm()
                                            : keyframe.camera().width_px);
  }
  return Median(std::move(distances_px));
}

}  // namespace

Sim3<World, World> LoopMatch::Correction(const SlamMap& map) const {
  const Sim3<World, Camera> S_world_old(map.FindKeyframe(old)->T_world_camera());
  const Sim3<World, Camera> S_world_newest(map.FindKeyframe(newest)->T_world_camera());
  return S_world_old * S_old_newest * S_world_newest.Inverse();
}

std::optional<LoopMatch> LoopDetector::Find(const MapKeyframe& keyframe, bool scale_is_known) const {
  std::set<KeyframeId> connected = {keyframe.id};
  for (const auto& [id, shared] : map_->Covisible(keyframe, kMinSharedPoints)) connected.insert(id);
  std::vector<LocatedFrame> places;
  int tried = 0;
  for (const KeyframeId id :
       places_->SimilarKeyframes(*keyframe.frame, kMaxLoopCandidates + static_cast<int>(connected.size()))) {
    if (connected.contains(id) || id.value + kMinLoopKeyframes > keyframe.id.value) continue;
    const MapKeyframe* old = map_->FindKeyframe(id);
    if (old == nullptr || rejected_.Contains(keyframe.id, id)) continue;
    if (++tried > kTriedCandidates) break;
    if (auto located = places_->Locate(*keyframe.frame, *old, keyframe.id.value)) places.push_back(*std::move(located));
  }
  // The place with most points first.
  std::stable_sort(places.begin(), places.end(),
                   [](const LocatedFrame& a, const LocatedFrame& b) { return a.points.size() > b.points.size(); });
  for (const LocatedFrame& located : places) {
    const std::optional<LoopMatch> loop = MakeLoop(keyframe, located, scale_is_known);
    if (loop && IsVerified(keyframe, located, *loop, places, scale_is_known)) return loop;
  }
  return std::nullopt;
}

bool LoopDetector::IsVerified(const MapKeyframe& keyframe, const LocatedFrame& located, const LoopMatch& loop,
                              const std::vector<LocatedFrame>& places, bool scale_is_known) const {
  if (loop.drift_px < kNoDrift_px) return true;  // agrees with the map as it is
  const auto fits_as_well = [&](const LocatedFrame& other) {
    return static_cast<double>(other.points.size()) > kLoopRivalShare * static_cast<double>(located.points.size());
  };
  const std::string name = keyframe.id.ToString() + " to " + loop.old.ToString();
  for (const LocatedFrame& place : places) {
    if (!fits_as_well(place) || !AreRivals(located, place)) continue;
    spdlog::debug("slam: loop {} rejected: the place of {} fits as well", name, place.keyframe.ToString());
    return false;
  }
  const Sim3<World, World> S_new_old = loop.Correction(*map_);
  const DriftBound bound = DriftBetween(*map_, loop.old, keyframe.id, scale_is_known);
  const double turn_deg = Eigen::AngleAxisd(S_new_old.rotation()).angle() * kDegPerRad;
  const double distance_mu = (S_new_old * keyframe.center_world() - keyframe.center_world()).norm();
  const std::string drift = fmt::format(
      "correction {:.1f} deg, {:.3f} map units, scale {:.3f}; drift bound {:.1f} deg, {:.3f}, {:.3f} over "
      "{} keyframes, {:.2f} map units and {:.0f} deg",
      turn_deg, distance_mu, S_new_old.scale(), bound.rotation_rad * kDegPerRad, bound.translation_mu,
      std::exp(bound.log_scale), bound.path_keyframes, bound.path_mu, bound.turn_rad * kDegPerRad);
  if (!IsWithin(bound, S_new_old, keyframe)) {
    spdlog::debug("slam: loop {} rejected: more than the map can have drifted: {}", name, drift);
    return false;
  }
  if (IsExplainedByCurrentPose(keyframe, located)) {
    spdlog::debug("slam: loop {} rejected: the current pose explains the old place as well", name);
    return false;
  }
  const int supporting = CountSupportingKeyframes(keyframe, loop);
  spdlog::debug("slam: loop {}: {} earlier keyframes agree; {}", name, supporting, drift);
  return supporting >= kMinSupportingKeyframes;
}

// Whether the old points are also found near the keyframe's current pose, at other features.
bool LoopDetector::IsExplainedByCurrentPose(const MapKeyframe& keyframe, const LocatedFrame& located) const {
  const MapKeyframe& old = *map_->FindKeyframe(located.keyframe);
  const auto current = places_->LocateNear(*keyframe.frame, old, keyframe.T_world_camera());
  if (!current) return false;
  if (static_cast<double>(current->points.size()) < kLoopRivalShare * static_cast<double>(located.points.size())) {
    return false;
  }
  // With little drift, the search near the current pose ends at the loop's pose.
  return MedianDistance_px(keyframe, current->T_world_camera, *map_, located) > kNoDrift_px;
}

int LoopDetector::CountSupportingKeyframes(const MapKeyframe& keyframe, const LoopMatch& loop) const {
  const Sim3<World, World> S_new_old = loop.Correction(*map_);
  const MapKeyframe& old = *map_->FindKeyframe(loop.old);
  int supporting = 0;
  size_t asked = 0;
  for (auto it = std::make_reverse_iterator(map_->keyframes().find(keyframe.id));
       it != map_->keyframes().rend() && asked < kEarlierKeyframes; ++it, ++asked) {
    const MapKeyframe& earlier = it->second;
    if (earlier.id.value <= loop.old.value + kMinLoopKeyframes) break;
    const SE3<World, Camera> T_world_camera = S_new_old.Moved(earlier.T_world_camera());
    const auto located = places_->LocateNear(*earlier.frame, old, T_world_camera);
    supporting += located && MedianDistance_px(earlier, T_world_camera, *map_, *located) < kMaxDisagreement_px ? 1 : 0;
  }
  return supporting;
}

std::optional<LoopMatch> LoopDetector::MakeLoop(const MapKeyframe& keyframe, const LocatedFrame& located,
                                                bool scale_is_known) const {
  const MapKeyframe& old = *map_->FindKeyframe(located.keyframe);
  LoopMatch loop{.newest = keyframe.id, .old = old.id};
  const SE3<Camera, World>& T_old_world = old.T_camera_world();
  std::vector<SimilarityMatch> common;
  for (const auto& [id, feature_index] : located.points) {
    const MapPointId observed = keyframe.points[static_cast<size_t>(feature_index)];
    if (!observed) continue;
    if (observed != id) loop.same_points.emplace_back(observed, id);
    const Eigen::Vector3d p_old = T_old_world * map_->FindPoint(id)->point.position_world;
    const Eigen::Vector3d& p_newest = map_->FindPoint(observed)->point.position_world;
    common.push_back(MatchAtPlace(keyframe, feature_index, p_old, keyframe.T_camera_world() * p_newest, config_));
  }
  loop.drift_px = MedianDistance_px(keyframe, keyframe.T_world_camera(), *map_, located);
  loop.S_old_newest = Sim3<Camera, Camera>(T_old_world * located.T_world_camera);
  if (scale_is_known || loop.drift_px < kNoDrift_px) return loop;
  // Only points that exist on both sides determine the ratio of their scales.
  const auto similarity = SolveSimilarity(keyframe.camera(), common,
                                          {.min_inliers = kMinCommonPoints, .seed = config_.Seed(keyframe.id.value)});
  spdlog::debug("slam: loop candidate {} to {}: drift {:.1f} px, {} of {} common points agree", keyframe.id.ToString(),
                old.id.ToString(), loop.drift_px, similarity ? similarity->inliers : 0, common.size());
  if (!similarity) return std::nullopt;
  loop.S_old_newest = similarity->S_first_second;
  return loop;
}

}  // namespace romap::slam
