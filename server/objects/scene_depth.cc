#include "server/objects/scene_depth.h"

#include <vector>

#include "common/statistics.h"

namespace romap::objects {

void SceneDepth::Update(const KeyframeView& view) {
  const SE3<Camera, World> T_camera_world = view.T_world_camera.Inverse();
  std::vector<double> depths_mu;
  for (const MapPoint& point : view.points) {
    const double z_mu = (T_camera_world * point.position_world).z();
    if (z_mu > 0) depths_mu.push_back(z_mu);
  }
  if (depths_mu.empty()) return;
  keyframe_ = view.id;
  depth_mu_ = Median(std::move(depths_mu));
}

void SceneDepth::Correct(const KeyframeCorrections& keyframes) {
  const auto corrected = keyframes.find(keyframe_);
  if (corrected != keyframes.end()) depth_mu_ *= corrected->second.S_new_old.scale();
}

}  // namespace romap::objects
