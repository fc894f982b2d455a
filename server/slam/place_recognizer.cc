#include "server/slam/place_recognizer.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <set>
#include <utility>

#include "common/angles.h"
#include "common/statistics.h"
#include "server/slam/point_maker.h"
#include "server/slam/projection_search.h"

namespace romap::slam {
namespace {

constexpr int kCandidates = 5;
constexpr int kMaxPlaceDistance = 60;  // Hamming, bits
constexpr double kRatio = 0.85;
constexpr int kMinPlaceFirstInliers = 12;  // of matches by descriptors
constexpr int kMinPoints = 40;             // after a search by projection
constexpr double kMinPlaceInlierShare = 0.5;
constexpr double kPlaceRadius_px = 10;
constexpr double kNarrowRadius_px = 4;
constexpr size_t kFewNeighbors = 3;
constexpr size_t kPlaceNeighbors = 8;
constexpr double kRivalRotation_rad = 10 * kRadPerDeg;
constexpr double kRivalDistanceShare = 0.2;  // of the scene depth
// A second place with this share of the best place's points fits the frame as well: descriptors and visibility
// alone change the number of points of the true place by a third from one keyframe to the next.
constexpr double kRivalPointShare = 0.7;

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

SimilarityMatch MatchAtPlace(const MapKeyframe& keyframe, int feature, const Eigen::Vector3d& p_place,
                             const Eigen::Vector3d& p_camera, const SlamConfig& config) {
  const Feature& observed = keyframe.features()[static_cast<size_t>(feature)];
  const double sigma_px = config.pixel_sigma_px * observed.octave_scale;
  return {.p_first = p_place,
          .p_second = p_camera,
          .first_px = keyframe.camera().Project(p_place),
          .second_px = observed.pixel_px.cast<double>(),
          .first_sigma_px = sigma_px,
          .second_sigma_px = sigma_px};
}

bool AreRivals(const LocatedFrame& a, const LocatedFrame& b) {
  const double rotation_rad = a.T_world_camera.rotation().angularDistance(b.T_world_camera.rotation());
  const double distance_mu = (a.T_world_camera.translation() - b.T_world_camera.translation()).norm();
  return rotation_rad > kRivalRotation_rad || distance_mu > kRivalDistanceShare * a.median_depth_mu;
}

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

std::optional<LocatedFrame> PlaceRecognizer::Locate(const FrameFeatures& frame, const MapKeyframe& around,
                                                    uint64_t call) const {
  const std::vector<LocalPoint> points = MakeLocalPoints(*map_, PointsAround(around, kFewNeighbors));
  std::vector<PoseObservation> observations;
  for (const PointMatch& match : MatchByDescriptors(points, frame, kMaxPlaceDistance, kRatio)) {
    observations.push_back(
        MakeObservation(frame, match.feature, points[static_cast<size_t>(match.point)].position_world, config_));
  }
  const auto pose =
      SolvePnp(frame.camera, observations, {.min_inliers = kMinPlaceFirstInliers, .seed = config_.Seed(call)});
  return pose ? LocateNear(frame, around, pose->T_world_camera) : std::nullopt;
}

std::optional<LocatedFrame> PlaceRecognizer::LocateNear(const FrameFeatures& frame, const MapKeyframe& around_keyframe,
                                                        const SE3<World, Camera>& T_world_camera) const {
  const std::vector<LocalPoint> around = MakeLocalPoints(*map_, PointsAround(around_keyframe, kPlaceNeighbors));
  LocatedFrame located{.keyframe = around_keyframe.id, .T_world_camera = T_world_camera};
  std::vector<PoseObservation> observations;
  PoseEstimate refined;
  for (const double radius_px : {kPlaceRadius_px, kNarrowRadius_px}) {
    ProjectionMatcher matcher(frame, located.T_world_camera);
    const auto matches = matcher.MatchAll(around, {.radius_px = radius_px, .max_distance = kMaxPlaceDistance}, {});
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
  if (refined.inliers < kMinPoints ||
      refined.inliers < kMinPlaceInlierShare * static_cast<double>(observations.size())) {
    return std::nullopt;
  }
  const SE3<Camera, World> T_camera_world = located.T_world_camera.Inverse();
  std::vector<double> depths_mu;
  for (const auto& [id, feature] : located.points) {
    depths_mu.push_back((T_camera_world * map_->FindPoint(id)->point.position_world).z());
  }
  located.median_depth_mu = Median(std::move(depths_mu));
  return located;
}

std::vector<KeyframeId> PlaceRecognizer::SimilarKeyframes(const FrameFeatures& frame, int max_results) const {
  std::vector<KeyframeId> keyframes;
  for (const PlaceMatch& match : index_.Query(frame.features, max_results)) keyframes.push_back(match.keyframe);
  return keyframes;
}

std::optional<LocatedFrame> PlaceRecognizer::Relocalize(const FrameFeatures& frame) const {
  std::vector<LocatedFrame> places;
  for (const KeyframeId id : SimilarKeyframes(frame, kCandidates)) {
    const MapKeyframe* keyframe = map_->FindKeyframe(id);
    if (keyframe == nullptr) continue;
    if (auto located = Locate(frame, *keyframe, frame.frame_id)) places.push_back(*std::move(located));
  }
  if (places.empty()) return std::nullopt;
  const auto best = std::max_element(places.begin(), places.end(), [](const LocatedFrame& a, const LocatedFrame& b) {
    return a.points.size() < b.points.size();
  });
  for (const LocatedFrame& place : places) {
    const bool fits_as_well =
        static_cast<double>(place.points.size()) > kRivalPointShare * static_cast<double>(best->points.size());
    if (!fits_as_well || !AreRivals(*best, place)) continue;
    spdlog::info("slam: frame {} fits the places of {} ({} points) and of {} ({} points): ambiguous, not relocalized",
                 frame.frame_id, best->keyframe.ToString(), best->points.size(), place.keyframe.ToString(),
                 place.points.size());
    return std::nullopt;
  }
  return *best;
}

}  // namespace romap::slam
