#include "server/slam/place_recogniser.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <unordered_map>
#include <utility>

#include "server/slam/geometry/similarity.h"
#include "server/slam/point_maker.h"
#include "server/slam/projection_search.h"

namespace romap {
namespace {

constexpr int kCandidates = 5;
constexpr int kMaxDistance = 60;  // Hamming, bits
constexpr double kRatio = 0.85;
constexpr int kMinCameraInliers = 15;  // of matches by looks
constexpr int kMinCameraPoints = 40;   // after a search by projection
constexpr double kCameraRadius_px = 8;
constexpr size_t kNeighbours = 8;

constexpr int kMinSharedPoints = 15;
constexpr int kMinLoopMatches = 20;
constexpr int kMinLoopPoints = 45;
constexpr double kLoopRadius_px = 6;
constexpr uint64_t kMinLoopKeyframes = 10;  // between both ends

std::vector<LocalPoint> LooksOfAll(const SlamMap& map, const std::vector<MapPointId>& ids) {
  std::vector<LocalPoint> looks;
  for (const MapPointId id : ids) looks.push_back(LooksOf(*map.FindPoint(id)));
  return looks;
}

PoseObservation Observe(const FrameFeatures& sight, int feature, const Eigen::Vector3d& p_world,
                        const SlamConfig& config) {
  const Feature& f = sight.features[static_cast<size_t>(feature)];
  return {
      .p_world = p_world, .pixel_px = f.pixel_px.cast<double>(), .sigma_px = config.pixel_sigma_px * f.octave_scale};
}

}  // namespace

std::vector<MapPointId> PlaceRecogniser::PointsAround(const MapKeyframe& keyframe, size_t neighbours) const {
  std::set<MapPointId> points;
  const auto take = [&](const MapKeyframe& from) {
    for (const MapPointId id : from.points) {
      if (id) points.insert(id);
    }
  };
  take(keyframe);
  for (const auto& [id, shared] : map_->Covisible(keyframe, kMinSharedPoints)) {
    if (neighbours-- == 0) break;
    take(*map_->FindKeyframe(id));
  }
  return {points.begin(), points.end()};
}

std::optional<PlaceRecogniser::Found> PlaceRecogniser::FindCamera(const FrameFeatures& sight) const {
  for (const PlaceMatch& candidate : index_.Query(sight.features, kCandidates)) {
    const MapKeyframe* place = map_->FindKeyframe(candidate.keyframe);
    if (place == nullptr) continue;
    const std::vector<LocalPoint> points = LooksOfAll(*map_, PointsAround(*place, 2));
    std::vector<PoseObservation> observations;
    for (const PointMatch& match : MatchByLooks(points, sight, kMaxDistance, kRatio)) {
      observations.push_back(
          Observe(sight, match.feature, points[static_cast<size_t>(match.point)].position_world, config_));
    }
    const auto pose =
        SolvePnp(sight.camera, observations, {.min_inliers = kMinCameraInliers, .seed = config_.Seed(sight.frame_id)});
    if (!pose) continue;

    const std::vector<LocalPoint> around = LooksOfAll(*map_, PointsAround(*place, kNeighbours));
    ProjectionMatcher matcher(sight, pose->T_world_camera);
    const ProjectionSearch search{.radius_px = kCameraRadius_px, .max_distance = kMaxDistance};
    observations.clear();
    for (const PointMatch& match : matcher.MatchAll(around, search, {})) {
      observations.push_back(
          Observe(sight, match.feature, around[static_cast<size_t>(match.point)].position_world, config_));
    }
    PoseEstimate refined = RefinePose(sight.camera, pose->T_world_camera, observations);
    spdlog::debug("slam: frame {} looks like {}: {} of {} points", sight.frame_id, place->id.ToString(),
                  refined.inliers, observations.size());
    if (refined.inliers >= kMinCameraPoints) return Found{std::move(refined), place->id};
  }
  return std::nullopt;
}

std::optional<LoopMatch> PlaceRecogniser::FindLoop(const MapKeyframe& keyframe, bool fix_scale) const {
  std::set<KeyframeId> connected = {keyframe.id};
  for (const auto& [id, shared] : map_->Covisible(keyframe, 1)) connected.insert(id);
  const std::vector<PlaceMatch> candidates =
      index_.Query(keyframe.features(), kCandidates + static_cast<int>(connected.size()));
  int tried = 0;
  for (const PlaceMatch& candidate : candidates) {
    if (connected.contains(candidate.keyframe) || candidate.keyframe.value + kMinLoopKeyframes > keyframe.id.value) {
      continue;
    }
    if (++tried > kCandidates) break;
    const MapKeyframe* place = map_->FindKeyframe(candidate.keyframe);
    if (place == nullptr) continue;
    if (auto loop = Verify(keyframe, *place, fix_scale)) return loop;
  }
  return std::nullopt;
}

std::optional<LoopMatch> PlaceRecogniser::Verify(const MapKeyframe& keyframe, const MapKeyframe& place,
                                                 bool fix_scale) const {
  // Matches between what both see, by looks alone.
  const auto own_points = [&](const MapKeyframe& of, std::vector<MapPointId>& ids, std::vector<int>& features) {
    for (size_t i = 0; i < of.points.size(); ++i) {
      if (!of.points[i]) continue;
      ids.push_back(of.points[i]);
      features.push_back(static_cast<int>(i));
    }
  };
  std::vector<MapPointId> new_ids, old_ids;
  std::vector<int> new_features, old_features;
  own_points(keyframe, new_ids, new_features);
  own_points(place, old_ids, old_features);
  const std::vector<LocalPoint> old_points = LooksOfAll(*map_, old_ids);
  std::vector<SimilarityMatch> matches;
  std::unordered_map<int, size_t> point_of_feature;
  for (size_t i = 0; i < new_features.size(); ++i) point_of_feature[new_features[i]] = i;
  for (const PointMatch& match : MatchByLooks(old_points, *keyframe.sight, kMaxDistance, kRatio)) {
    const auto seen = point_of_feature.find(match.feature);
    if (seen == point_of_feature.end()) continue;
    const auto old = static_cast<size_t>(match.point);
    const Feature& new_feature = keyframe.features()[static_cast<size_t>(match.feature)];
    const Feature& old_feature = place.features()[static_cast<size_t>(old_features[old])];
    matches.push_back(
        {.p_first = place.T_camera_world() * old_points[old].position_world,
         .p_second = keyframe.T_camera_world() * map_->FindPoint(new_ids[seen->second])->point.position_world,
         .first_px = old_feature.pixel_px.cast<double>(),
         .second_px = new_feature.pixel_px.cast<double>(),
         .first_sigma_px = config_.pixel_sigma_px * old_feature.octave_scale,
         .second_sigma_px = config_.pixel_sigma_px * new_feature.octave_scale});
  }
  const SimilarityOptions options{
      .fix_scale = fix_scale, .min_inliers = kMinLoopMatches, .seed = config_.Seed(keyframe.id.value)};
  if (matches.size() < static_cast<size_t>(kMinLoopMatches)) return std::nullopt;
  const auto similarity = SolveSimilarity(keyframe.camera(), matches, options);
  if (!similarity) return std::nullopt;

  // More points of the old place, where that similarity says they are.
  LoopMatch loop{.keyframe = keyframe.id, .place = place.id, .S_place_keyframe = similarity->S_first_second};
  const Sim3<World, Camera> S_world_keyframe = Sim3<World, Camera>(place.T_world_camera()) * loop.S_place_keyframe;
  std::vector<LocalPoint> around = LooksOfAll(*map_, PointsAround(place, kNeighbours));
  // In the keyframe's own unit of length.
  const Sim3<World, World> S_new_old =
      Sim3<World, World>(Sim3<World, Camera>(keyframe.T_world_camera()) * S_world_keyframe.Inverse());
  std::vector<LocalPoint> moved = around;
  for (LocalPoint& point : moved) {
    point.position_world = S_new_old * point.position_world;
    point.direction_world = S_new_old.rotation() * point.direction_world;
    point.size_mu *= S_new_old.scale();
  }
  ProjectionMatcher matcher(*keyframe.sight, keyframe.T_world_camera());
  const ProjectionSearch search{.radius_px = kLoopRadius_px, .max_distance = kMaxDistance};
  std::vector<double> disagreements_px;
  int found = 0;
  for (const PointMatch& match : matcher.MatchAll(moved, search, {})) {
    const auto i = static_cast<size_t>(match.point);
    const Feature& feature = keyframe.features()[static_cast<size_t>(match.feature)];
    const Eigen::Vector2d there_px = keyframe.camera().Project(keyframe.T_camera_world() * moved[i].position_world);
    const double error_px = (there_px - feature.pixel_px.cast<double>()).norm();
    if (error_px > 3 * config_.pixel_sigma_px * feature.octave_scale) continue;
    ++found;
    const Eigen::Vector3d as_it_is = keyframe.T_camera_world() * around[i].position_world;
    if (as_it_is.z() > 0) {
      disagreements_px.push_back((keyframe.camera().Project(as_it_is) - feature.pixel_px.cast<double>()).norm());
    } else {
      disagreements_px.push_back(keyframe.camera().width_px);
    }
    const MapPointId seen = keyframe.points[static_cast<size_t>(match.feature)];
    if (seen && seen != around[i].id) loop.same_points.emplace_back(seen, around[i].id);
  }
  spdlog::debug("slam: {} against {}: {} of {} matches, then {} points", keyframe.id.ToString(), place.id.ToString(),
                similarity->inliers, matches.size(), found);
  if (found < kMinLoopPoints) return std::nullopt;
  const auto middle = disagreements_px.begin() + static_cast<std::ptrdiff_t>(disagreements_px.size() / 2);
  std::nth_element(disagreements_px.begin(), middle, disagreements_px.end());
  loop.disagreement_px = *middle;
  return loop;
}

}  // namespace romap
