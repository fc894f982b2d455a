#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace romap::nerf {

// The signed distance from the center of each cell to the border of the volume of all cells that are `inside`, positive
// outside. `inside`: [kOccupancyResolution^3], x fastest; `extent`: the sides of the grid, whose unit is that of the
// distances. Exact within ten cells of the border; clamped to that distance beyond, and everywhere without a border.
std::vector<float> DistanceToBorder(std::span<const uint8_t> inside, const Eigen::Vector3f& extent);

}  // namespace romap::nerf
