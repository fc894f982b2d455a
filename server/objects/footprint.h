#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "common/cuboid.h"

namespace romap::objects {

// The rectangle an upright object covers, in the horizontal plane of a Grid frame (see HullRegion).
struct Footprint {
  double yaw_rad = 0;  // of the rectangle's x axis
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  Eigen::Vector2d half_extents = Eigen::Vector2d::Zero();  // map units, along the rectangle's own axes
};

// Rectangle of least area around grid cells (by their centres; half a cell is added on each side). `edge_yaw_rad`, the
// direction of the object's straight edges, is taken instead of the least area's unless the rectangle would be much
// larger. Without it, a footprint that is nearly as small under `previous_yaw_rad` keeps that yaw, and a round one
// keeps it or takes 0, so that the box of a cup does not spin. The yaw is the one nearest to the previous yaw (else to
// 0) among the four of the same rectangle. nullopt for fewer than four cells.
std::optional<Footprint> FitFootprint(const std::vector<Eigen::Vector3d>& cells, const Eigen::Vector3d& cell_size,
                                      std::optional<double> previous_yaw_rad,
                                      std::optional<double> edge_yaw_rad = std::nullopt);

// Yaw of an upright cuboid in a Grid frame.
double YawInGrid(const Cuboid& cuboid, const Eigen::Matrix3d& R_world_grid);

}  // namespace romap::objects
