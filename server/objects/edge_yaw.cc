#include "server/objects/edge_yaw.h"

#include <vector>

#include "server/objects/lines/yaw_from_lines.h"

namespace romap {

std::optional<double> EdgeYaw(std::span<const Silhouette> silhouettes, const Eigen::Matrix3d& R_world_grid,
                              double min_confidence) {
  std::vector<LineView> views;
  views.reserve(silhouettes.size());
  for (const Silhouette& silhouette : silhouettes) {
    views.push_back({silhouette.camera, silhouette.T_world_camera.RotationMatrix(), silhouette.segments});
  }
  const auto estimate = YawFromLines(R_world_grid, views);
  if (!estimate || !(estimate->confidence > min_confidence)) return std::nullopt;
  return estimate->yaw_rad;
}

}  // namespace romap
