#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace romap::nerf {

// Signed distance of the middles of cells to the border of a body of cells, positive outside, in the unit of `extent`,
// the sides of the grid. `inside` [kOccupancyResolution^3], x fastest. Exact up to some cells from the border, beyond
// that a bound; without a border everywhere the bound.
std::vector<float> DistanceToBorder(std::span<const uint8_t> inside, const Eigen::Vector3f& extent);

}  // namespace romap::nerf
