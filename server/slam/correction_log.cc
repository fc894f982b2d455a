#include "server/slam/correction_log.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "common/statistics.h"

namespace romap::slam {
namespace {

// A third of a pixel for a camera of 600 px focal length.
constexpr double kNoticeable_rad = 0.0005;

double MedianDepth_mu(const KeyframeView& view) {
  const SE3<Camera, World> T_camera_world = view.T_world_camera.Inverse();
  std::vector<double> depths_mu;
  for (const MapPoint& point : view.points) depths_mu.push_back((T_camera_world * point.position_world).z());
  if (depths_mu.empty()) return 0;
  return Median(std::move(depths_mu));
}

}  // namespace

void CorrectionLog::Tell(const KeyframeView& view, double scale) {
  keyframes_[view.id] = {view.T_world_camera, scale, MedianDepth_mu(view)};
  const Eigen::Vector3d center_world = view.T_world_camera.translation();
  for (const MapPoint& point : view.points) {
    points_[point.id] = {point.position_world, 2 * kNoticeable_rad * (point.position_world - center_world).norm()};
  }
  for (const MapPointId gone : view.removed_points) points_.erase(gone);
}

MapCorrection CorrectionLog::Take(const SlamMap& map) {
  MapCorrection correction;
  for (auto& [id, told] : keyframes_) {
    const auto now = map.KeyframePose(id);
    if (!now) continue;
    const double turn_rad = now->T_world_camera.rotation().angularDistance(told.T_world_camera.rotation());
    const double way_mu = (now->T_world_camera.translation() - told.T_world_camera.translation()).norm();
    const double scale = now->scale / told.scale;
    if (turn_rad < kNoticeable_rad && way_mu < kNoticeable_rad * told.depth_mu && std::abs(scale - 1) < 1e-3) continue;
    const Eigen::Quaterniond turn = now->T_world_camera.rotation() * told.T_world_camera.rotation().conjugate();
    const Eigen::Vector3d shift =
        now->T_world_camera.translation() - scale * (turn * told.T_world_camera.translation());
    correction.keyframes.push_back(
        {.id = id, .T_world_camera = now->T_world_camera, .S_new_old = {scale, turn, shift}});
    told.T_world_camera = now->T_world_camera;
    told.depth_mu *= scale;
    told.scale = now->scale;
  }
  for (auto it = points_.begin(); it != points_.end();) {
    const PointTrack* track = map.FindPoint(it->first);
    if (track == nullptr || track->point.id != it->first) {
      it = points_.erase(it);
      continue;
    }
    ToldPoint& told = it->second;
    if ((track->point.position_world - told.position_world).norm() > told.noticeable_mu) {
      correction.points.push_back(track->point);
      told.position_world = track->point.position_world;
    }
    ++it;
  }
  return correction;
}

void CorrectionLog::Forget() {
  keyframes_.clear();
  points_.clear();
}

}  // namespace romap::slam
