#include "server/nerf/training_box.h"

#include <cmath>

#include "common/status.h"

namespace romap::nerf {
namespace {

constexpr double kMinMargin = 0.02;   // of the longest half extent; keeps the surface of flat objects inside
constexpr double kMinFill = 0.4;      // of the volume; a smaller cuboid needs a finer grid
constexpr double kMaxTilt_rad = 0.2;  // between the box and the upright cuboid

}  // namespace

TrainingBox TrainingBox::Around(const Cuboid& cuboid, double enlargement) {
  TrainingBox box;
  box.T_world_object = cuboid.T_world_object;
  const Eigen::Vector3d& half = cuboid.half_extents;
  box.half_extents = (half * (1.0 + enlargement)).cwiseMax((half.array() + kMinMargin * half.maxCoeff()).matrix());
  box.unit_mu = box.LongestSide_mu();
  return box;
}

TrainingBox TrainingBox::Refitted(const Cuboid& cuboid, double enlargement) const {
  TrainingBox box = Around(cuboid, enlargement);
  const SE3<Object, Object> T_old_new = T_world_object.Inverse() * box.T_world_object;
  box.unit_mu = unit_mu;
  box.R_grid_box = R_grid_box * T_old_new.RotationMatrix();
  box.corner_grid_unit = R_grid_box * ToUnit(T_old_new * (-box.half_extents)) + corner_grid_unit;
  return box;
}

nerf::GridPose TrainingBox::GridPose() const {
  nerf::GridPose pose;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) pose.rotation[r][c] = static_cast<float>(R_grid_box(r, c));
    pose.shift[r] = static_cast<float>(corner_grid_unit[r]);
  }
  return pose;
}

TrainingBox TrainingBox::Moved(const Sim3<World, World>& S_new_old) const {
  return {S_new_old.Moved(T_world_object), S_new_old.scale() * half_extents, S_new_old.scale() * unit_mu, R_grid_box,
          corner_grid_unit};
}

bool TrainingBox::StillFits(const Cuboid& cuboid) const {
  const SE3<Object, World> T_object_world = T_world_object.Inverse();
  Eigen::Quaterniond rotation = T_object_world.rotation() * cuboid.T_world_object.rotation();
  const Eigen::Vector3d up = rotation * Eigen::Vector3d::UnitZ();
  if (up.z() > std::cos(kMaxTilt_rad)) rotation = ShortestRotation(up, Eigen::Vector3d::UnitZ()) * rotation;
  const SE3<Object, Object> T_object_cuboid(rotation, T_object_world * cuboid.T_world_object.translation());
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
    const Eigen::Vector3d p = T_object_cuboid * sign.cwiseProduct(cuboid.half_extents);
    if ((p.cwiseAbs().array() > half_extents.array()).any()) return false;
  }
  return cuboid.half_extents.prod() >= kMinFill * half_extents.prod();
}

Eigen::Affine3d TrainingBox::ShareOf(const TrainingBox& other) const {
  const SE3<Object, Object> T_this_other = T_world_object.Inverse() * other.T_world_object;
  const Eigen::Vector3d per_side = (2.0 * half_extents).cwiseInverse();
  Eigen::Affine3d share;
  share.linear() = per_side.asDiagonal() * T_this_other.RotationMatrix() * (2.0 * other.half_extents).asDiagonal();
  share.translation() = per_side.cwiseProduct(T_this_other * (-other.half_extents) + half_extents);
  return share;
}

double TrainingBox::ShareCovered(const TrainingBox& other) const {
  constexpr int kSamples = 8;  // per axis
  const Eigen::Affine3d share = ShareOf(other);
  int inside = 0;
  for (int i = 0; i < kSamples * kSamples * kSamples; ++i) {
    const Eigen::Vector3d sample(i % kSamples, i / kSamples % kSamples, i / (kSamples * kSamples));
    const Eigen::Vector3d p = share * ((sample.array() + 0.5) / kSamples).matrix();
    if ((p.array() >= 0).all() && (p.array() <= 1).all()) ++inside;
  }
  return inside / std::pow(kSamples, 3);
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

}  // namespace romap::nerf
