#include "server/slam/correction_log.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "common/statistics.h"

namespace romap::slam {
namespace {

// A third of a pixel for a camera of 600 px focal length.
constexpr double kNoticeable_rad = 0.0005;
constexpr double kNoticeableScale = 1e-3;  // relative

double MedianDepth_mu(const KeyframeView& view) {
  const SE3<Camera, World> T_camera_world = view.T_world_camera.Inverse();
  std::vector<double> depths_mu;
  for (const MapPoint& point : view.points) depths_mu.push_back((T_camera_world * point.position_world).z());
  if (depths_mu.empty()) return 0;
  return Median(std::move(depths_mu));
}

}  // namespace

void CorrectionLog::Record(const KeyframeView& view, double scale) {
  keyframes_[view.id] = {{view.T_world_camera, scale}, MedianDepth_mu(view)};
  const Eigen::Vector3d center_world = view.T_world_camera.translation();
  for (const MapPoint& point : view.points) {
    points_[point.id] = {point.position_world, 2 * kNoticeable_rad * (point.position_world - center_world).norm()};
  }
  for (const MapPointId removed : view.removed_points) points_.erase(removed);
}

std::map<KeyframeId, PoseUncertainty> CorrectionLog::Uncertainties(const SlamMap& map) const {
  std::map<KeyframeId, PoseUncertainty> uncertainties;
  for (const auto& [id, recorded] : keyframes_) {
    if (const auto uncertainty = map.KeyframeUncertainty(id)) uncertainties[id] = *uncertainty;
  }
  return uncertainties;
}

void CorrectionLog::Append(CorrectionLog other) {
  keyframes_.merge(other.keyframes_);
  points_.merge(other.points_);
}

MapCorrection CorrectionLog::TakeCorrection(const SlamMap& map) {
  MapCorrection correction;
  for (auto& [id, recorded] : keyframes_) {
    const auto now = map.KeyframePose(id);
    if (!now) continue;
    const SE3<World, Camera>& before = recorded.pose.T_world_camera;
    const SE3<World, Camera>& after = now->T_world_camera;
    const double rotation_rad = after.rotation().angularDistance(before.rotation());
    const double distance_mu = (after.translation() - before.translation()).norm();
    const double scale = now->scale / recorded.pose.scale;
    const bool is_negligible = rotation_rad < kNoticeable_rad && distance_mu < kNoticeable_rad * recorded.depth_mu &&
                               std::abs(scale - 1) < kNoticeableScale;
    if (is_negligible) continue;
    const Eigen::Quaterniond rotation = after.rotation() * before.rotation().conjugate();
    const Eigen::Vector3d shift = after.translation() - scale * (rotation * before.translation());
    correction.keyframes.push_back({.id = id, .T_world_camera = after, .S_new_old = {scale, rotation, shift}});
    recorded = {*now, scale * recorded.depth_mu};
  }
  for (auto it = points_.begin(); it != points_.end();) {
    const PointTrack* track = map.FindPoint(it->first);
    if (track == nullptr || track->point.id != it->first) {
      it = points_.erase(it);
      continue;
    }
    RecordedPoint& recorded = it->second;
    if ((track->point.position_world - recorded.position_world).norm() > recorded.noticeable_mu) {
      correction.points.push_back(track->point);
      recorded.position_world = track->point.position_world;
    }
    ++it;
  }
  return correction;
}

}  // namespace romap::slam
