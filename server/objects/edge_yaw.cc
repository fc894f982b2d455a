#include "server/objects/edge_yaw.h"

#include <vector>

namespace romap::objects {

std::optional<YawEstimate> EdgeYaw(std::span<const Silhouette> silhouettes, const Eigen::Matrix3d& R_world_grid) {
  std::vector<LineView> views;
  views.reserve(silhouettes.size());
  for (const Silhouette& silhouette : silhouettes) {
    if (silhouette.segments.empty()) continue;
    views.push_back({silhouette.camera, silhouette.T_world_camera.RotationMatrix(), silhouette.segments});
  }
  return YawFromLines(R_world_grid, views);
}

}  // namespace romap::objects
