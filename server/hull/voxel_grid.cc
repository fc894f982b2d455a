#include "server/hull/voxel_grid.h"

#include <cmath>

namespace romap::hull {

std::optional<size_t> VoxelGrid::CellAt(const Eigen::Vector3d& p) const {
  size_t index = 0;
  for (int axis = 2; axis >= 0; --axis) {
    const double cell = std::floor((p[axis] / half_extents[axis] + 1) / 2 * cells);
    if (!(cell >= 0 && cell < cells)) return std::nullopt;
    index = index * static_cast<size_t>(cells) + static_cast<size_t>(cell);
  }
  return index;
}

}  // namespace romap::hull
