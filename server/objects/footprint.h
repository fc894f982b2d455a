#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "common/cuboid.h"

namespace romap::objects {

// The rectangle that an upright object covers in the horizontal plane of a Grid frame (see HullRegion).
struct Footprint {
  double yaw_rad = 0;  // of the rectangle's x axis
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  Eigen::Vector2d half_extents = Eigen::Vector2d::Zero();  // map units, along the rectangle's own axes
};

// The smallest rectangle around grid cells, given by their centers; half a cell is added on each side. With
// `edge_yaw_rad`, the direction of the object's straight edges, the rectangle has this yaw unless its area is much
// larger. Otherwise a footprint that is nearly as small at `previous_yaw_rad` keeps that yaw, and a round footprint
// keeps it or has yaw 0, so that the cuboid of a cup does not rotate between fits. Of the four equivalent yaws of a
// rectangle the result is nearest to the previous one (or to 0). nullopt for fewer than four cells.
std::optional<Footprint> FitFootprint(const std::vector<Eigen::Vector3d>& cells, const Eigen::Vector3d& cell_size,
                                      std::optional<double> previous_yaw_rad,
                                      std::optional<double> edge_yaw_rad = std::nullopt);

// Yaw of an upright cuboid in a Grid frame.
double YawInGrid(const Cuboid& cuboid, const Eigen::Matrix3d& R_world_grid);

}  // namespace romap::objects
