#include "server/objects/point_cuboid.h"

#include <Eigen/Geometry>

#include "server/objects/pca_yaw.h"

namespace romap::objects {

std::optional<Cuboid> CuboidOfPoints(const HullRegion& region, std::span<const Eigen::Vector3d> points,
                                     std::optional<double> edge_yaw_rad) {
  constexpr size_t kMinPoints = 3;
  if (points.size() < kMinPoints) return std::nullopt;
  const double yaw_rad = edge_yaw_rad ? *edge_yaw_rad : PcaYaw(points).value_or(0);
  const Eigen::Matrix3d R_grid_object = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  Eigen::AlignedBox3d bounds;
  for (const Eigen::Vector3d& p_grid : points) bounds.extend(R_grid_object.transpose() * p_grid);
  Cuboid cuboid;
  cuboid.T_world_object = {Eigen::Matrix3d(region.R_world_grid * R_grid_object),
                           region.ToWorld(R_grid_object * bounds.center())};
  cuboid.half_extents = bounds.sizes() / 2;
  const bool has_volume = cuboid.half_extents.allFinite() && cuboid.half_extents.minCoeff() > 0;
  if (!has_volume || !cuboid.T_world_object.IsFinite()) return std::nullopt;
  return cuboid;
}

}  // namespace romap::objects
