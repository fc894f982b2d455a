#include "server/slam/common_place.h"

#include <spdlog/spdlog.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "common/angles.h"
#include "server/slam/geometry/similarity.h"
#include "server/slam/place_recognizer.h"
#include "server/slam/point_maker.h"
#include "server/slam/projection_search.h"

namespace romap::slam {
namespace {

constexpr int kKeptCandidates = 5;  // by descriptors
constexpr int kMinSamePoints = 25;  // that the similarity explains
// Another place with this share of the points makes the place ambiguous.
constexpr double kOtherPlaceShare = 0.6;
// Largest difference between the alignments by two keyframes: at the camera and at the depth of the scene.
constexpr double kMaxTurn_rad = 4 * kRadPerDeg;
constexpr double kMaxShiftShare = 0.1;  // of the depth
constexpr double kMaxLogScale = 0.1;
// The image is divided into cells. See MatchedArea().
constexpr size_t kAreaColumns = 6;
constexpr size_t kAreaRows = 4;
constexpr int kMinPointsInCell = 4;
constexpr double kMinFoundShare = 0.15;  // of the points in a cell
constexpr double kMinMatchedArea = 0.5;

bool FitsAsWell(const LocatedFrame& other, size_t points) {
  return static_cast<double>(other.points.size()) > kOtherPlaceShare * static_cast<double>(points);
}

// Share of the image, among the parts that should show points of the kept keyframe, where such points were found. A
// object that exists twice, for instance a poster, is found in its own part only.
double MatchedArea(const MapKeyframe& keyframe, const LocatedFrame& located, const SlamMap& kept) {
  struct Cell {
    int expected = 0;
    int found = 0;
  };
  std::array<Cell, kAreaColumns * kAreaRows> cells;
  std::set<MapPointId> found;
  for (const auto& [id, feature] : located.points) found.insert(id);
  const CameraModel& camera = keyframe.camera();
  const ProjectionMatcher matcher(*keyframe.frame, located.T_world_camera);
  for (const MapPointId id : kept.FindKeyframe(located.keyframe)->points) {
    if (!id) continue;
    const auto seen = matcher.Predict(MakeLocalPoint(*kept.FindPoint(id)), ProjectionSearch{}.min_view_cosine);
    if (!seen) continue;
    const auto column = static_cast<size_t>(seen->pixel_px.x() * kAreaColumns / camera.width_px);
    const auto row = static_cast<size_t>(seen->pixel_px.y() * kAreaRows / camera.height_px);
    Cell& cell = cells[row * kAreaColumns + column];
    ++cell.expected;
    cell.found += found.contains(id) ? 1 : 0;
  }
  int expected = 0;
  int matched = 0;
  for (const Cell& cell : cells) {
    if (cell.expected < kMinPointsInCell) continue;
    ++expected;
    matched += cell.found >= kMinFoundShare * cell.expected ? 1 : 0;
  }
  return expected > 0 ? static_cast<double>(matched) / expected : 0;
}

// The points that the keyframe observes, as the current map and as the kept map have them.
std::vector<SimilarityMatch> SharedPoints(const MapKeyframe& keyframe, const LocatedFrame& located,
                                          const SlamMap& current, const SlamMap& kept, const SlamConfig& config,
                                          std::vector<std::pair<MapPointId, MapPointId>>& ids) {
  const SE3<Camera, World>& T_kept_world = kept.FindKeyframe(located.keyframe)->T_camera_world();
  std::vector<SimilarityMatch> matches;
  for (const auto& [id, feature_index] : located.points) {
    const MapPointId observed = keyframe.points[static_cast<size_t>(feature_index)];
    if (!observed) continue;
    const Eigen::Vector3d p_kept = T_kept_world * kept.FindPoint(id)->point.position_world;
    if (p_kept.z() <= 0) continue;
    ids.emplace_back(observed, id);
    const Eigen::Vector3d& p_current = current.FindPoint(observed)->point.position_world;
    matches.push_back(MatchAtPlace(keyframe, feature_index, p_kept, keyframe.T_camera_world() * p_current, config));
  }
  return matches;
}

}  // namespace

std::optional<Sim3<World, World>> CommonPlace::Alignment(const SlamMap& current, const SlamMap& kept_map) const {
  const MapKeyframe* from = current.FindKeyframe(keyframe);
  const MapKeyframe* into = kept_map.FindKeyframe(kept_keyframe);
  if (from == nullptr || into == nullptr) return std::nullopt;
  return Sim3<World, Camera>(into->T_world_camera()) * S_kept_current * Sim3<Camera, World>(from->T_camera_world());
}

bool HaveSameScale(const SessionMap& a, const SessionMap& b) { return a.ScaleIsKnown() && b.ScaleIsKnown(); }

std::optional<CommonPlace> FindCommonPlace(const MapKeyframe& keyframe, const SessionMap& current,
                                           const SessionMap& kept, const SlamConfig& config) {
  std::vector<LocatedFrame> places;
  for (const KeyframeId id : kept.places.SimilarKeyframes(*keyframe.frame, kKeptCandidates)) {
    const MapKeyframe* candidate = kept.map.FindKeyframe(id);
    if (candidate == nullptr) continue;
    if (auto located = kept.places.Locate(*keyframe.frame, *candidate, keyframe.id.value)) {
      places.push_back(*std::move(located));
    }
  }
  if (places.empty()) return std::nullopt;
  const LocatedFrame& best =
      *std::max_element(places.begin(), places.end(),
                        [](const LocatedFrame& a, const LocatedFrame& b) { return a.points.size() < b.points.size(); });
  for (const LocatedFrame& place : places) {
    if (!FitsAsWell(place, best.points.size()) || !AreRivals(best, place)) continue;
    spdlog::debug("slam: {} fits the places of {} and {} of {}: ambiguous", keyframe.id.ToString(),
                  best.keyframe.ToString(), place.keyframe.ToString(), kept.id.ToString());
    return std::nullopt;
  }
  const double area = MatchedArea(keyframe, best, kept.map);
  if (area < kMinMatchedArea) {
    spdlog::debug("slam: {} shows only a part of what {} of {} shows: {:.0f} % of the image", keyframe.id.ToString(),
                  best.keyframe.ToString(), kept.id.ToString(), 100 * area);
    return std::nullopt;
  }
  CommonPlace common{.kept = kept.id, .keyframe = keyframe.id, .kept_keyframe = best.keyframe};
  common.depth_mu = best.median_depth_mu;
  std::vector<std::pair<MapPointId, MapPointId>> ids;
  const std::vector<SimilarityMatch> matches = SharedPoints(keyframe, best, current.map, kept.map, config, ids);
  const auto similarity = SolveSimilarity(keyframe.camera(), matches,
                                          {.fix_scale = HaveSameScale(current, kept),
                                           .min_inliers = kMinSamePoints,
                                           .seed = config.Seed(keyframe.id.value)});
  spdlog::debug("slam: {} and {} of {}: {} of {} common points agree on a similarity, in {:.0f} % of the image",
                keyframe.id.ToString(), best.keyframe.ToString(), kept.id.ToString(),
                similarity ? similarity->inliers : 0, matches.size(), 100 * area);
  if (!similarity) return std::nullopt;
  common.S_kept_current = similarity->S_first_second;
  for (size_t i = 0; i < ids.size(); ++i) {
    if (similarity->inlier[i] != 0) common.same_points.push_back(ids[i]);
  }
  return common;
}

bool Agree(const CommonPlace& a, const CommonPlace& b, const SlamMap& current, const SlamMap& kept) {
  if (a.kept != b.kept) return false;
  const auto S_a = a.Alignment(current, kept);
  const auto S_b = b.Alignment(current, kept);
  if (!S_a || !S_b) return false;
  const Eigen::Vector3d& center_world = current.FindKeyframe(b.keyframe)->center_world();
  const double shift_mu = (*S_a * center_world - *S_b * center_world).norm();
  return S_a->rotation().angularDistance(S_b->rotation()) < kMaxTurn_rad && shift_mu < kMaxShiftShare * b.depth_mu &&
         std::abs(std::log(S_a->scale() / S_b->scale())) < kMaxLogScale;
}

bool IsAmbiguous(const CommonPlace& place, const SessionMap& current, const SessionMap& kept) {
  const auto S_kept_current = place.Alignment(current.map, kept.map);
  const MapKeyframe* kept_keyframe = kept.map.FindKeyframe(place.kept_keyframe);
  if (!S_kept_current || kept_keyframe == nullptr) return true;
  LocatedFrame expected{.keyframe = place.keyframe};
  expected.T_world_camera = S_kept_current->Inverse().Moved(kept_keyframe->T_world_camera());
  expected.median_depth_mu = place.depth_mu / S_kept_current->scale();
  for (const KeyframeId id : current.places.SimilarKeyframes(*kept_keyframe->frame, kKeptCandidates)) {
    const MapKeyframe* candidate = current.map.FindKeyframe(id);
    if (candidate == nullptr) continue;
    const auto located = current.places.Locate(*kept_keyframe->frame, *candidate, kept_keyframe->id.value);
    if (located && FitsAsWell(*located, place.same_points.size()) && AreRivals(expected, *located)) return true;
  }
  return false;
}

}  // namespace romap::slam
