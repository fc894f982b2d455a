#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>

namespace romap::hull {

// A box, centered at the origin of its frame and aligned with its axes, divided into `cells` cells along each side.
// Arrays over the cells are indexed with x fastest.
struct VoxelGrid {
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();  // map units
  int cells = 0;

  size_t size() const { return Index(0, 0, cells); }
  size_t Index(int x, int y, int z) const {
    const auto side = static_cast<size_t>(cells);
    return (static_cast<size_t>(z) * side + static_cast<size_t>(y)) * side + static_cast<size_t>(x);
  }
  Eigen::Vector3d CellSize() const { return 2.0 / cells * half_extents; }
  // Center of the block of `side` cells along each axis whose lowest cell is `first`.
  Eigen::Vector3d BlockCenter(const Eigen::Vector3i& first, int side) const {
    return (2.0 * (first.cast<double>().array() + 0.5 * side) / cells - 1) * half_extents.array();
  }
  Eigen::Vector3d CellCenter(int x, int y, int z) const { return BlockCenter({x, y, z}, 1); }
  // Index of the cell that contains a point; nullopt outside the box.
  std::optional<size_t> CellAt(const Eigen::Vector3d& p) const;
};

}  // namespace romap::hull
