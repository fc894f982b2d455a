#include "server/nerf/training_box.h"

#include <cmath>

#include "common/status.h"

namespace romap {
namespace {

constexpr double kSmallestMargin = 0.02;  // of the longest side: room for the surface of sheets
constexpr double kSmallestFill = 0.4;     // of the volume; a cuboid that shrank below deserves a finer grid
constexpr double kMostLean_rad = 0.2;     // between a box that was turned and an upright cuboid

}  // namespace

TrainingBox TrainingBox::Around(const Cuboid& cuboid, double enlargement) {
  TrainingBox box;
  box.T_world_object = cuboid.T_world_object;
  const Eigen::Vector3d& half = cuboid.half_extents;
  box.half_extents = (half * (1.0 + enlargement)).cwiseMax((half.array() + kSmallestMargin * half.maxCoeff()).matrix());
  box.side_mu = 2.0 * box.half_extents.maxCoeff();
  return box;
}

TrainingBox TrainingBox::Moved(const Sim3<World, World>& S_new_old) const {
  return {S_new_old.Moved(T_world_object), S_new_old.scale() * half_extents, S_new_old.scale() * side_mu};
}

bool TrainingBox::StillFits(const Cuboid& cuboid) const {
  const SE3<Object, World> T_object_world = T_world_object.Inverse();
  Eigen::Quaterniond rotation = T_object_world.rotation() * cuboid.T_world_object.rotation();
  const Eigen::Vector3d up = rotation * Eigen::Vector3d::UnitZ();
  if (up.z() > std::cos(kMostLean_rad)) rotation = ShortestRotation(up, Eigen::Vector3d::UnitZ()) * rotation;
  const SE3<Object, Object> T_object_cuboid(rotation, T_object_world * cuboid.T_world_object.translation());
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
    const Eigen::Vector3d p = T_object_cuboid * sign.cwiseProduct(cuboid.half_extents);
    if ((p.cwiseAbs().array() > half_extents.array()).any()) return false;
  }
  return cuboid.half_extents.prod() >= kSmallestFill * half_extents.prod();
}

absl::Status ValidateCuboid(const Cuboid& cuboid) {
  if (!cuboid.T_world_object.IsFinite()) return InvalidArgument("cuboid: pose is not finite");
  const Eigen::Vector3d& half = cuboid.half_extents;
  if (!half.allFinite() || half.minCoeff() <= 0) {
    return InvalidArgument("cuboid: half extents must be positive and finite, got ({}, {}, {})", half.x(), half.y(),
                           half.z());
  }
  return absl::OkStatus();
}

}  // namespace romap
