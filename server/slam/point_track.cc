#include "server/slam/point_track.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace romap {
namespace {

constexpr size_t kMaxSights = 16;
constexpr double kMaxViewChangeCosine = 0.7;  // 45 degrees; ORB does not survive more
constexpr double kMaxSizeRatio = 1.7;         // between predicted and found octave scale
constexpr double kProjectionRatio = 0.9;      // best over second best; milder than along a line as the area is small
constexpr float kSameSpot_px = 3;

// Drops the sight that differs least from the one before it; the first and the last one stay.
void DropMostRedundant(const Eigen::Vector3d& p_world, std::vector<Sight>& sights) {
  size_t redundant = 1;
  double smallest_rad = std::numeric_limits<double>::infinity();
  for (size_t i = 1; i + 1 < sights.size(); ++i) {
    const double gap_rad = Parallax_rad(sights[i - 1], sights[i], p_world);
    if (gap_rad < smallest_rad) {
      smallest_rad = gap_rad;
      redundant = i;
    }
  }
  sights.erase(sights.begin() + static_cast<std::ptrdiff_t>(redundant));
}

// Remembers how the point looks in its newest keyframe.
void TakeLooks(const MapKeyframe& keyframe, int feature, PointTrack& track) {
  const auto i = static_cast<size_t>(feature);
  const double range_mu = (track.point.position_world - keyframe.center_world()).norm();
  track.descriptor = keyframe.features[i].descriptor;
  track.latest_bearing_world = keyframe.bearings_world[i];
  track.size_mu = keyframe.features[i].octave_scale * range_mu / keyframe.camera.fx_px;
  track.latest_keyframe = keyframe.id.value;
}

}  // namespace

Sight SightOf(const MapKeyframe& keyframe, int feature, const SlamConfig& config) {
  const auto i = static_cast<size_t>(feature);
  return {.center_world = keyframe.center_world(),
          .bearing_world = keyframe.bearings_world[i],
          .bearing_sigma_rad = config.pixel_sigma_px * keyframe.features[i].octave_scale / keyframe.camera.fx_px,
          .range_mu = keyframe.ranges_mu[i],
          .range_sigma_mu = config.depth_sigma_ratio * keyframe.ranges_mu[i]};
}

std::optional<Sighting> FindInKeyframe(const PointTrack& track, const MapKeyframe& keyframe, const SlamConfig& config) {
  const Eigen::Vector3d p_camera = keyframe.T_camera_world * track.point.position_world;
  if (p_camera.z() <= 0) return std::nullopt;
  const Eigen::Vector2d pixel_px = keyframe.camera.Project(p_camera);
  if (pixel_px.x() < 0 || pixel_px.y() < 0 || pixel_px.x() > keyframe.camera.width_px - 1 ||
      pixel_px.y() > keyframe.camera.height_px - 1) {
    return std::nullopt;
  }
  const Eigen::Vector3d ray = track.point.position_world - keyframe.center_world();
  if (ray.normalized().dot(track.latest_bearing_world) < kMaxViewChangeCosine) return std::nullopt;
  const double scale = track.size_mu * keyframe.camera.fx_px / ray.norm();

  std::vector<int> near;
  const double radius_px = config.search_radius_px * std::clamp(scale, 1.0, 3.0);
  keyframe.grid.Near(pixel_px, radius_px, near);
  std::optional<Sighting> best;
  int second_distance = 256;
  for (const int index : near) {
    const Feature& feature = keyframe.features[static_cast<size_t>(index)];
    if (keyframe.points[static_cast<size_t>(index)]) continue;
    if ((feature.pixel_px.cast<double>() - pixel_px).norm() > radius_px) continue;
    if (feature.octave_scale > scale * kMaxSizeRatio || scale > feature.octave_scale * kMaxSizeRatio) continue;
    const int distance = HammingDistance(feature.descriptor, track.descriptor);
    const bool is_rival =
        best && (keyframe.features[static_cast<size_t>(best->feature)].pixel_px - feature.pixel_px).norm() >
                    kSameSpot_px * static_cast<float>(feature.octave_scale);
    if (!best || distance < best->distance) {
      if (is_rival) second_distance = best->distance;
      best = {index, distance};
    } else if (is_rival) {
      second_distance = std::min(second_distance, distance);
    }
  }
  if (!best || best->distance > config.max_descriptor_distance) return std::nullopt;
  if (best->distance > kProjectionRatio * second_distance) return std::nullopt;
  return best;
}

PointTrack StartTrack(MapPointId id, const MapKeyframe& keyframe, int feature, const Eigen::Vector3d& p_world,
                      const SlamConfig& config) {
  PointTrack track{.point = {.id = id, .position_world = p_world, .observations = 1},
                   .sights = {SightOf(keyframe, feature, config)}};
  TakeLooks(keyframe, feature, track);
  return track;
}

bool AddSight(const MapKeyframe& keyframe, int feature, const SlamConfig& config, PointTrack& track) {
  std::vector<Sight> sights = track.sights;
  sights.push_back(SightOf(keyframe, feature, config));
  const Eigen::Vector3d p_world = RefinePoint(sights, track.point.position_world);
  if (!std::all_of(sights.begin(), sights.end(), [&](const Sight& sight) { return Agrees(sight, p_world); })) {
    return false;
  }
  track.point.max_parallax_rad = std::max(track.point.max_parallax_rad, MaxParallax_rad(sights, p_world));
  if (sights.size() > kMaxSights) DropMostRedundant(p_world, sights);
  track.sights = std::move(sights);
  track.point.position_world = p_world;
  ++track.point.observations;
  if (keyframe.id.value > track.latest_keyframe) TakeLooks(keyframe, feature, track);
  return true;
}

}  // namespace romap
