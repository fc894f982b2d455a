#include "client/cli/cuboid_outline.h"

namespace romap::cli {

std::optional<cv::Rect2d> CuboidOutline(const Cuboid& cuboid, const CameraModel& camera,
                                        const SE3<World, Camera>& T_world_camera) {
  const SE3<Camera, Object> T_camera_object = T_world_camera.Inverse() * cuboid.T_world_object;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9), high = -low;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d signs((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1, (corner & 4) != 0 ? 1 : -1);
    const Eigen::Vector3d p_camera = T_camera_object * cuboid.half_extents.cwiseProduct(signs);
    if (p_camera.z() <= 0) return std::nullopt;
    const Eigen::Vector2d pixel = camera.Project(p_camera);
    low = low.cwiseMin(pixel);
    high = high.cwiseMax(pixel);
  }
  if (low.x() < 0 || low.y() < 0 || high.x() >= camera.width_px || high.y() >= camera.height_px) return std::nullopt;
  return cv::Rect2d(low.x(), low.y(), high.x() - low.x(), high.y() - low.y());
}

}  // namespace romap::cli
