#include "server/slam/projection_search.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "server/slam/descriptor_matching.h"

namespace romap::slam {
namespace {

constexpr double kMaxSizeRatio = 1.7;  // between predicted and found octave scale
constexpr float kSameCorner_px = 3;    // times the octave scale; closer candidates are the same corner

}  // namespace

ProjectionMatcher::ProjectionMatcher(const FrameFeatures& frame, const SE3<World, Camera>& T_world_camera)
    : frame_(frame), T_camera_world_(T_world_camera.Inverse()), center_world_(T_world_camera.translation()) {}

std::optional<ProjectionMatcher::Prediction> ProjectionMatcher::Predict(const LocalPoint& point,
                                                                        double min_view_cosine) const {
  const Eigen::Vector3d p_camera = T_camera_world_ * point.position_world;
  if (p_camera.z() <= 0) return std::nullopt;
  const CameraModel& camera = frame_.camera;
  const Eigen::Vector2d pixel_px = camera.Project(p_camera);
  if (pixel_px.x() < 0 || pixel_px.y() < 0 || pixel_px.x() > camera.width_px - 1 ||
      pixel_px.y() > camera.height_px - 1) {
    return std::nullopt;
  }
  const Eigen::Vector3d ray = point.position_world - center_world_;
  const double range_mu = ray.norm();
  if (ray.dot(point.direction_world) < min_view_cosine * range_mu) return std::nullopt;
  return Prediction{pixel_px, point.size_mu * camera.fx_px / range_mu};
}

std::optional<FoundFeature> ProjectionMatcher::Find(const LocalPoint& point, const ProjectionSearch& search,
                                                    std::span<const uint8_t> taken) {
  const std::optional<Prediction> prediction = Predict(point, search.min_view_cosine);
  if (!prediction) return std::nullopt;
  const double scale = prediction->octave_scale;
  const double radius_px = search.radius_px * std::clamp(scale, 1.0, 3.0);
  frame_.grid.Near(prediction->pixel_px, radius_px, near_);
  std::optional<FoundFeature> best;
  int second_distance = 256;
  for (const int index : near_) {
    const auto i = static_cast<size_t>(index);
    const Feature& feature = frame_.features[i];
    if (!taken.empty() && taken[i] != 0) continue;
    if ((feature.pixel_px.cast<double>() - prediction->pixel_px).squaredNorm() > radius_px * radius_px) continue;
    if (feature.octave_scale > scale * kMaxSizeRatio || scale > feature.octave_scale * kMaxSizeRatio) continue;
    const int distance = HammingDistance(feature.descriptor, point.descriptor);
    const bool is_other_corner =
        best && (frame_.features[static_cast<size_t>(best->feature)].pixel_px - feature.pixel_px).norm() >
                    kSameCorner_px * static_cast<float>(feature.octave_scale);
    if (!best || distance < best->distance) {
      if (is_other_corner) second_distance = best->distance;
      best = {index, distance};
    } else if (is_other_corner) {
      second_distance = std::min(second_distance, distance);
    }
  }
  if (!best || best->distance > search.max_distance) return std::nullopt;
  if (best->distance > search.ratio * second_distance) return std::nullopt;
  return best;
}

std::vector<PointMatch> ProjectionMatcher::MatchAll(std::span<const LocalPoint> points, const ProjectionSearch& search,
                                                    std::span<const uint8_t> taken) {
  std::vector<PointMatch> matches;
  std::vector<int> match_of_feature(frame_.size(), -1);
  for (size_t i = 0; i < points.size(); ++i) {
    const std::optional<FoundFeature> found = Find(points[i], search, taken);
    if (!found) continue;
    const PointMatch match{static_cast<int>(i), found->feature, found->distance};
    int& earlier = match_of_feature[static_cast<size_t>(found->feature)];
    if (earlier < 0) {
      earlier = static_cast<int>(matches.size());
      matches.push_back(match);
    } else if (match.distance < matches[static_cast<size_t>(earlier)].distance) {
      matches[static_cast<size_t>(earlier)] = match;
    }
  }
  return matches;
}

std::vector<PointMatch> MatchByDescriptors(std::span<const LocalPoint> points, const FrameFeatures& frame,
                                           int max_distance, double ratio) {
  std::vector<Descriptor> of_points, of_features;
  of_points.reserve(points.size());
  of_features.reserve(frame.size());
  for (const LocalPoint& point : points) of_points.push_back(point.descriptor);
  for (const Feature& feature : frame.features) of_features.push_back(feature.descriptor);
  std::vector<PointMatch> matches;
  for (const DescriptorMatch& match : MatchDescriptors(of_points, of_features, max_distance, ratio)) {
    matches.push_back({match.first, match.second, match.distance});
  }
  return matches;
}

}  // namespace romap::slam
