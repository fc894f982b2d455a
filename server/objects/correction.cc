#include "server/objects/correction.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace romap::objects {

std::optional<Sim3<World, World>> MeanMotion(std::span<const KeyframeId> observed_in,
                                             const Eigen::Vector3d& center_world,
                                             const KeyframeCorrections& corrections) {
  Eigen::Vector4d rotation_sum = Eigen::Vector4d::Zero();
  Eigen::Vector3d center_sum = Eigen::Vector3d::Zero();
  double log_scale_sum = 0;
  bool any_moved = false;
  for (const KeyframeId& id : observed_in) {
    const auto moved = corrections.find(id);
    const Sim3<World, World> S = moved == corrections.end() ? Sim3<World, World>() : moved->second.S_new_old;
    any_moved |= moved != corrections.end();
    // q and -q are the same rotation; the mean needs quaternions of one hemisphere.
    const Eigen::Vector4d q = S.rotation().coeffs();
    rotation_sum += q.dot(rotation_sum) < 0 ? -q : q;
    center_sum += S * center_world;
    log_scale_sum += std::log(S.scale());
  }
  if (!any_moved) return std::nullopt;
  const auto count = static_cast<double>(observed_in.size());
  const double scale = std::exp(log_scale_sum / count);
  const Eigen::Quaterniond rotation = Eigen::Quaterniond(rotation_sum).normalized();
  return Sim3<World, World>(scale, rotation, center_sum / count - scale * (rotation * center_world));
}

Cuboid Upright(Cuboid cuboid, const Eigen::Vector3d& up_world) {
  const SE3<World, Object>& T = cuboid.T_world_object;
  const Eigen::Quaterniond straighten = ShortestRotation(T.rotation() * Eigen::Vector3d::UnitZ(), up_world);
  cuboid.T_world_object = {straighten * T.rotation(), T.translation()};
  return cuboid;
}

double LargestShift_px(const Cuboid& cuboid, const CameraModel& camera, const SE3<World, Camera>& T_world_camera_a,
                       const SE3<World, Camera>& T_world_camera_b) {
  const SE3<Camera, World> T_a_world = T_world_camera_a.Inverse();
  const SE3<Camera, World> T_b_world = T_world_camera_b.Inverse();
  double largest = 0;
  for (const Eigen::Vector3d& corner : CuboidCorners(cuboid)) {
    const Eigen::Vector3d a = T_a_world * corner;
    const Eigen::Vector3d b = T_b_world * corner;
    if (!(a.z() > 0) && !(b.z() > 0)) continue;
    if (!(a.z() > 0 && b.z() > 0)) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, (camera.Project(a) - camera.Project(b)).norm());
  }
  return largest;
}

}  // namespace romap::objects
