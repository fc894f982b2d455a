#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "server/slam/slam_map.h"

namespace romap::slam {

// The positions of the points of a map in its world, map units. Of a map with more than `max_points`, evenly spaced
// ones by id.
std::vector<Eigen::Vector3f> PointPositions(const SlamMap& map, size_t max_points);

}  // namespace romap::slam
