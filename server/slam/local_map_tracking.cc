#include "server/slam/local_map_tracking.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <utility>

#include "common/statistics.h"
#include "server/slam/geometry/pnp.h"
#include "server/slam/geometry/pose_covariance.h"
#include "server/slam/geometry/pose_refiner.h"
#include "server/slam/projection_search.h"

namespace romap::slam {
namespace {

constexpr int kMinFirstInliers = 20;      // of the search for the last frame's points
constexpr int kMinLooseInliers = 10;      // before patches confirm the pose
constexpr double kMinInlierShare = 0.35;  // of the matches with all points
constexpr double kWideRadius_px = 36;
constexpr double kLocalRadius_px = 3.5;
constexpr int kMaxDistance = 70;          // Hamming, bits, where a projection narrows the search
constexpr int kMaxUnguidedDistance = 60;  // Hamming, bits, where the search area is large or unlimited
constexpr double kUnguidedRatio = 0.8;
constexpr size_t kMaxPatches = 150;
constexpr double kMinPatchViewCosine = 0.8;  // of the mean ray; the patch's own ray is tested later

std::vector<LocalPoint> PointsAt(const LocalMap& map, const std::vector<int>& indices) {
  std::vector<LocalPoint> points;
  points.reserve(indices.size());
  for (const int index : indices) points.push_back(map.points[static_cast<size_t>(index)]);
  return points;
}

}  // namespace

std::optional<PoseFromPoints> LocalMapTracking::TrackByProjection(const std::vector<MapPointId>& ids,
                                                                  const SE3<World, Camera>& start,
                                                                  double radius_px) const {
  return TrackAround(IndicesOrAll(ids), start, radius_px, kMinFirstInliers);
}

std::optional<PoseFromPoints> LocalMapTracking::TrackLoosely(const SE3<World, Camera>& start, double radius_px) const {
  return TrackAround(IndicesOrAll({}), start, radius_px, kMinLooseInliers);
}

std::optional<PoseFromPoints> LocalMapTracking::TrackAround(const std::vector<int>& indices,
                                                            const SE3<World, Camera>& start, double radius_px,
                                                            int min_inliers) const {
  const std::vector<LocalPoint> points = PointsAt(map_, indices);
  ProjectionMatcher matcher(frame_, start);
  const ProjectionSearch search{.radius_px = radius_px, .max_distance = kMaxDistance, .ratio = 0.9};
  std::vector<int> point_of_feature(frame_.size(), -1);
  for (const PointMatch& match : matcher.MatchAll(points, search, {})) {
    point_of_feature[static_cast<size_t>(match.feature)] = indices[static_cast<size_t>(match.point)];
  }
  return Refine(start, std::move(point_of_feature), min_inliers);
}

std::optional<PoseFromPoints> LocalMapTracking::TrackByDescriptors(const std::vector<MapPointId>& ids) const {
  const std::vector<int> indices = IndicesOrAll(ids);
  const std::vector<LocalPoint> points = PointsAt(map_, indices);
  const std::vector<PointMatch> matches = MatchByDescriptors(points, frame_, kMaxUnguidedDistance, kUnguidedRatio);
  std::vector<PoseObservation> observations;
  for (const PointMatch& match : matches) {
    const Feature& feature = frame_.features[static_cast<size_t>(match.feature)];
    observations.push_back({.p_world = points[static_cast<size_t>(match.point)].position_world,
                            .pixel_px = feature.pixel_px.cast<double>(),
                            .sigma_px = config_.pixel_sigma_px * feature.octave_scale});
  }
  const auto pose =
      SolvePnp(frame_.camera, observations, {.min_inliers = kMinFirstInliers, .seed = config_.Seed(frame_.frame_id)});
  if (!pose) return std::nullopt;
  std::vector<int> point_of_feature(frame_.size(), -1);
  for (size_t i = 0; i < matches.size(); ++i) {
    if (pose->inlier[i] == 0) continue;
    point_of_feature[static_cast<size_t>(matches[i].feature)] = indices[static_cast<size_t>(matches[i].point)];
  }
  return Refine(pose->T_world_camera, std::move(point_of_feature), kMinFirstInliers);
}

std::optional<PoseFromPoints> LocalMapTracking::TrackNear(const SE3<World, Camera>& start) const {
  ProjectionMatcher matcher(frame_, start);
  const ProjectionSearch search{.radius_px = kWideRadius_px, .max_distance = kMaxUnguidedDistance, .ratio = 0.8};
  std::vector<int> point_of_feature(frame_.size(), -1);
  for (const PointMatch& match : matcher.MatchAll(map_.points, search, {})) {
    point_of_feature[static_cast<size_t>(match.feature)] = match.point;
  }
  return Refine(start, std::move(point_of_feature), kMinFirstInliers);
}

std::optional<PoseFromPoints> LocalMapTracking::TrackAllPoints(const PoseFromPoints& first, int min_inliers) const {
  std::vector<int> point_of_feature = first.point_of_feature;
  std::vector<uint8_t> is_feature_matched(frame_.size(), 0);
  std::vector<uint8_t> is_point_matched(map_.points.size(), 0);
  for (size_t i = 0; i < point_of_feature.size(); ++i) {
    if (point_of_feature[i] < 0) continue;
    is_feature_matched[i] = 1;
    is_point_matched[static_cast<size_t>(point_of_feature[i])] = 1;
  }
  ProjectionMatcher matcher(frame_, first.T_world_camera);
  const ProjectionSearch search{.radius_px = kLocalRadius_px, .max_distance = kMaxDistance, .ratio = 0.9};
  std::vector<int> distance_of(frame_.size(), 256);
  for (size_t p = 0; p < map_.points.size(); ++p) {
    if (is_point_matched[p] != 0) continue;
    const auto found = matcher.Find(map_.points[p], search, is_feature_matched);
    if (!found || found->distance >= distance_of[static_cast<size_t>(found->feature)]) continue;
    // Map points are more accurate than tentative ones.
    const bool is_tentative = !map_.points[p].id;
    if (is_tentative && point_of_feature[static_cast<size_t>(found->feature)] >= 0) continue;
    distance_of[static_cast<size_t>(found->feature)] = found->distance;
    point_of_feature[static_cast<size_t>(found->feature)] = static_cast<int>(p);
  }
  auto pose = Refine(first.T_world_camera, std::move(point_of_feature), min_inliers);
  if (pose && pose->inliers < kMinInlierShare * pose->matches) return std::nullopt;
  return pose;
}

std::optional<PoseFromPoints> LocalMapTracking::RefineMatches(const PoseFromPoints& pose,
                                                              const cv::Mat& image_bgr) const {
  auto refined = Refine(pose.T_world_camera, pose.point_of_feature, kMinLooseInliers);
  if (refined && !pose.points_by_patch.empty()) refined = AddPatches(*refined, HalvedImages(image_bgr));
  return refined;
}

double LocalMapTracking::MedianDepth_mu(const PoseFromPoints& pose) const {
  const SE3<Camera, World> T_camera_world = pose.T_world_camera.Inverse();
  std::vector<double> depths_mu;
  const auto add = [&](int point) {
    if (point >= 0) depths_mu.push_back((T_camera_world * map_.points[static_cast<size_t>(point)].position_world).z());
  };
  for (const int point : pose.point_of_feature) add(point);
  for (const int point : pose.points_by_patch) add(point);
  return depths_mu.empty() ? 0 : Median(std::move(depths_mu));
}

std::vector<double> LocalMapTracking::DepthsOfFeatures(const PoseFromPoints& pose) const {
  const SE3<Camera, World> T_camera_world = pose.T_world_camera.Inverse();
  std::vector<double> depths_mu(frame_.size(), 0);
  for (size_t i = 0; i < depths_mu.size(); ++i) {
    const int point = pose.point_of_feature[i];
    if (point >= 0) depths_mu[i] = (T_camera_world * map_.points[static_cast<size_t>(point)].position_world).z();
  }
  return depths_mu;
}

std::vector<int> LocalMapTracking::IndicesOrAll(const std::vector<MapPointId>& ids) const {
  std::vector<int> indices;
  for (const MapPointId id : ids) {
    const auto it = map_.index.find(id);
    if (it != map_.index.end()) indices.push_back(it->second);
  }
  if (indices.size() >= static_cast<size_t>(2 * kMinFirstInliers)) return indices;
  indices.resize(map_.points.size());
  std::iota(indices.begin(), indices.end(), 0);
  return indices;
}

std::optional<PoseFromPoints> LocalMapTracking::AddPatches(const PoseFromPoints& pose,
                                                           const HalvedImages& image) const {
  std::vector<uint8_t> is_matched(map_.points.size(), 0);
  for (const int point : pose.point_of_feature) {
    if (point >= 0) is_matched[static_cast<size_t>(point)] = 1;
  }
  ProjectionMatcher matcher(frame_, pose.T_world_camera);
  const PatchTarget target{.camera = frame_.camera,
                           .lens = frame_.lens,
                           .image = image,
                           .T_camera_world = pose.T_world_camera.Inverse(),
                           .center_world = pose.T_world_camera.translation(),
                           .shutter = frame_.shutter.get()};
  std::vector<PatchMatch> patches;
  // The points are in the order of their keyframes' features, so neighbors in it are neighbors in the image: a large
  // stride spreads the patches.
  const size_t count = map_.points.size();
  size_t stride = std::max<size_t>(1, static_cast<size_t>(0.618 * static_cast<double>(count)));
  while (std::gcd(stride, count) > 1) ++stride;
  for (size_t i = 0, p = 0; i < count && patches.size() < kMaxPatches; ++i, p = (p + stride) % count) {
    const LocalPoint& point = map_.points[p];
    if (is_matched[p] != 0 || !point.patch || !matcher.Predict(point, kMinPatchViewCosine)) continue;
    const auto reference = map_.keyframes.find(point.patch->keyframe);
    if (reference == map_.keyframes.end()) continue;
    const auto found = FindPatch(*point.patch, reference->second.T_world_camera, point.position_world, target);
    if (found) patches.push_back({.point = static_cast<int>(p), .found = *found});
  }
  return Refine(pose.T_world_camera, pose.point_of_feature, kMinFirstInliers, patches);
}

PoseObservation LocalMapTracking::Observe(int feature, int point) const {
  const auto i = static_cast<size_t>(feature);
  PoseObservation observation{.p_world = map_.points[static_cast<size_t>(point)].position_world,
                              .pixel_px = frame_.features[i].pixel_px.cast<double>(),
                              .sigma_px = config_.pixel_sigma_px * frame_.features[i].octave_scale};
  if (frame_.ranges_mu[i] > 0) {
    observation.depth_mu = frame_.ranges_mu[i] * frame_.bearings_camera[i].z();
    observation.depth_sigma_mu = config_.depth_sigma_ratio * observation.depth_mu;
  }
  return observation;
}

PoseObservation LocalMapTracking::Observe(const PatchMatch& match) const {
  Eigen::Vector2d pixel_px = frame_.lens.Undistort(frame_.camera, match.found.image_px);
  if (frame_.shutter) pixel_px = frame_.shutter->FromConverted(pixel_px, match.found.depth_mu);
  return {.p_world = map_.points[static_cast<size_t>(match.point)].position_world,
          .pixel_px = pixel_px,
          .sigma_px = config_.pixel_sigma_px * std::max(1.0, match.found.octave_scale)};
}

std::optional<PoseFromPoints> LocalMapTracking::Refine(const SE3<World, Camera>& start,
                                                       std::vector<int> point_of_feature, int min_inliers,
                                                       std::span<const PatchMatch> patches) const {
  std::vector<PoseObservation> observations;
  std::vector<size_t> feature_of;
  for (size_t i = 0; i < point_of_feature.size(); ++i) {
    if (point_of_feature[i] < 0) continue;
    observations.push_back(Observe(static_cast<int>(i), point_of_feature[i]));
    feature_of.push_back(i);
  }
  for (const PatchMatch& match : patches) observations.push_back(Observe(match));
  if (observations.size() < static_cast<size_t>(min_inliers)) return std::nullopt;
  const PoseEstimate pose = RefinePose(frame_.camera, start, observations);
  if (pose.inliers < min_inliers || !pose.T_world_camera.IsFinite()) return std::nullopt;
  PoseFromPoints result{.T_world_camera = pose.T_world_camera,
                        .point_of_feature = std::move(point_of_feature),
                        .inliers = pose.inliers,
                        .matches = static_cast<int>(observations.size())};
  if (const auto covariance = PoseCovariance(frame_.camera, pose, observations)) {
    result.uncertainty = {EquivalentSigma(covariance->topLeftCorner<3, 3>()),
                          EquivalentSigma(covariance->bottomRightCorner<3, 3>())};
  }
  for (size_t i = 0; i < feature_of.size(); ++i) {
    if (pose.inlier[i] == 0) result.point_of_feature[feature_of[i]] = -1;
  }
  for (size_t i = 0; i < patches.size(); ++i) {
    if (pose.inlier[feature_of.size() + i] != 0) result.points_by_patch.push_back(patches[i].point);
  }
  return result;
}

}  // namespace romap::slam
