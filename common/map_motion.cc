#include "common/map_motion.h"

namespace romap {

Cuboid Moved(const Sim3<World, World>& S_new_old, Cuboid cuboid) {
  cuboid.T_world_object = S_new_old.Moved(cuboid.T_world_object);
  cuboid.half_extents *= S_new_old.scale();
  return cuboid;
}

ObjectView Moved(const Sim3<World, World>& S_new_old, ObjectView view) {
  view.T_world_camera = S_new_old.Moved(view.T_world_camera);
  if (S_new_old.scale() == 1) return view;
  for (Eigen::Vector3f& point : view.sparse_depth) point.z() *= static_cast<float>(S_new_old.scale());
  if (!view.depth_mu.empty()) {
    cv::Mat scaled;  // the old image may be shared with other holders of the view
    view.depth_mu.convertTo(scaled, -1, S_new_old.scale());
    view.depth_mu = scaled;
  }
  return view;
}

}  // namespace romap
