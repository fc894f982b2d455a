#include "server/slam/place_recognizer.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "common/statistics.h"
#include "server/slam/geometry/similarity.h"
#include "server/slam/point_maker.h"
#include "server/slam/projection_search.h"

namespace romap::slam {
namespace {

constexpr int kCandidates = 5;
constexpr int kLoopCandidates = 3;
constexpr int kMaxDistance = 60;  // Hamming, bits
constexpr double kRatio = 0.85;
constexpr int kMinFirstInliers = 12;  // of matches by descriptors
constexpr int kMinPoints = 40;        // after a search by projection
constexpr double kMinInlierShare = 0.5;
constexpr double kWideRadius_px = 10;
constexpr double kNarrowRadius_px = 4;
constexpr size_t kFewNeighbors = 3;
constexpr size_t kNeighbors = 8;
constexpr int kMinCommonPoints = 15;
constexpr uint64_t kMinLoopKeyframes = 10;  // between the old and the newest keyframe

std::vector<LocalPoint> MakeLocalPoints(const SlamMap& map, const std::vector<MapPointId>& ids) {
  std::vector<LocalPoint> points;
  for (const MapPointId id : ids) points.push_back(MakeLocalPoint(*map.FindPoint(id)));
  return points;
}

PoseObservation MakeObservation(const FrameFeatures& frame, int feature, const Eigen::Vector3d& p_world,
                                const SlamConfig& config) {
  const Feature& f = frame.features[static_cast<size_t>(feature)];
  return {
      .p_world = p_world, .pixel_px = f.pixel_px.cast<double>(), .sigma_px = config.pixel_sigma_px * f.octave_scale};
}

}  // namespace

std::vector<MapPointId> PlaceRecognizer::PointsAround(const MapKeyframe& keyframe, size_t neighbors) const {
  std::set<MapPointId> points;
  const auto take = [&](const MapKeyframe& from) {
    for (const MapPointId id : from.points) {
      if (id) points.insert(id);
    }
  };
  take(keyframe);
  for (const auto& [id, shared] : map_->Covisible(keyframe, kMinSharedPoints)) {
    if (neighbors-- == 0) break;
    take(*map_->FindKeyframe(id));
  }
  return {points.begin(), points.end()};
}

std::optional<PlaceRecognizer::Located> PlaceRecognizer::Locate(const FrameFeatures& frame,
                                                                const MapKeyframe& around_keyframe,
                                                                uint64_t call) const {
  const std::vector<LocalPoint> points = MakeLocalPoints(*map_, PointsAround(around_keyframe, kFewNeighbors));
  std::vector<PoseObservation> observations;
  for (const PointMatch& match : MatchByDescriptors(points, frame, kMaxDistance, kRatio)) {
    observations.push_back(
        MakeObservation(frame, match.feature, points[static_cast<size_t>(match.point)].position_world, config_));
  }
  const auto pose = SolvePnp(frame.camera, observations, {.min_inliers = kMinFirstInliers, .seed = config_.Seed(call)});
  if (!pose) return std::nullopt;

  const std::vector<LocalPoint> around = MakeLocalPoints(*map_, PointsAround(around_keyframe, kNeighbors));
  Located located;
  located.T_world_camera = pose->T_world_camera;
  PoseEstimate refined;
  for (const double radius_px : {kWideRadius_px, kNarrowRadius_px}) {
    ProjectionMatcher matcher(frame, located.T_world_camera);
    const auto matches = matcher.MatchAll(around, {.radius_px = radius_px, .max_distance = kMaxDistance}, {});
    observations.clear();
    for (const PointMatch& match : matches) {
      observations.push_back(
          MakeObservation(frame, match.feature, around[static_cast<size_t>(match.point)].position_world, config_));
    }
    refined = RefinePose(frame.camera, located.T_world_camera, observations);
    located.T_world_camera = refined.T_world_camera;
    located.points.clear();
    for (size_t i = 0; i < matches.size(); ++i) {
      if (refined.inlier[i] == 0) continue;
      located.points.emplace_back(around[static_cast<size_t>(matches[i].point)].id, matches[i].feature);
    }
  }
  spdlog::debug("slam: frame {} compared with {}: {} of {} points agree", frame.frame_id, around_keyframe.id.ToString(),
                refined.inliers, observations.size());
  if (refined.inliers < kMinPoints || refined.inliers < kMinInlierShare * static_cast<double>(observations.size())) {
    return std::nullopt;
  }
  return located;
}

std::optional<PlaceRecognizer::Relocalized> PlaceRecognizer::Relocalize(const FrameFeatures& frame) const {
  for (const PlaceMatch& candidate : index_.Query(frame.features, kCandidates)) {
    const MapKeyframe* keyframe = map_->FindKeyframe(candidate.keyframe);
    if (keyframe == nullptr) continue;
    if (const auto located = Locate(frame, *keyframe, frame.frame_id)) {
      return Relocalized{located->T_world_camera, keyframe->id};
    }
  }
  return std::nullopt;
}

std::optional<LoopMatch> PlaceRecognizer::FindLoop(const MapKeyframe& keyframe, bool fix_scale) const {
  std::set<KeyframeId> connected = {keyframe.id};
  for (const auto& [id, shared] : map_->Covisible(keyframe, kMinSharedPoints)) connected.insert(id);
  int tried = 0;
  for (const PlaceMatch& candidate :
       index_.Query(keyframe.features(), kCandidates + static_cast<int>(connected.size()))) {
    if (connected.contains(candidate.keyframe) || candidate.keyframe.value + kMinLoopKeyframes > keyframe.id.value) {
      continue;
    }
    if (++tried > kLoopCandidates) break;
    const MapKeyframe* old = map_->FindKeyframe(candidate.keyframe);
    if (old == nullptr) continue;
    const auto located = Locate(*keyframe.frame, *old, keyframe.id.value);
    if (!located) continue;
    if (auto loop = MakeLoop(keyframe, *old, *located, fix_scale)) return loop;
  }
  return std::nullopt;
}

std::optional<LoopMatch> PlaceRecognizer::MakeLoop(const MapKeyframe& keyframe, const MapKeyframe& old,
                                                   const Located& located, bool fix_scale) const {
  LoopMatch loop{.newest = keyframe.id, .old = old.id};
  const SE3<Camera, World>& T_old_world = old.T_camera_world();
  std::vector<SimilarityMatch> common;
  std::vector<double> drifts_px;
  for (const auto& [id, feature_index] : located.points) {
    const Eigen::Vector3d& old_world = map_->FindPoint(id)->point.position_world;
    const Feature& feature = keyframe.features()[static_cast<size_t>(feature_index)];
    const Eigen::Vector3d p_camera = keyframe.T_camera_world() * old_world;
    drifts_px.push_back(p_camera.z() > 0
                            ? (keyframe.camera().Project(p_camera) - feature.pixel_px.cast<double>()).norm()
                            : keyframe.camera().width_px);
    const MapPointId observed = keyframe.points[static_cast<size_t>(feature_index)];
    if (!observed) continue;
    if (observed != id) loop.same_points.emplace_back(observed, id);
    const Eigen::Vector3d p_old = T_old_world * old_world;
    const double sigma_px = config_.pixel_sigma_px * feature.octave_scale;
    common.push_back({.p_first = p_old,
                      .p_second = keyframe.T_camera_world() * map_->FindPoint(observed)->point.position_world,
                      .first_px = keyframe.camera().Project(p_old),
                      .second_px = feature.pixel_px.cast<double>(),
                      .first_sigma_px = sigma_px,
                      .second_sigma_px = sigma_px});
  }
  loop.drift_px = Median(std::move(drifts_px));

  loop.S_old_newest = Sim3<Camera, Camera>(T_old_world * located.T_world_camera);
  if (fix_scale || loop.drift_px < kNoDrift_px) return loop;
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
