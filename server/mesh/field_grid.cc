#include "server/mesh/field_grid.h"

#include <algorithm>

namespace romap::mesh {

FieldGrid MakeEmptyGrid(const Eigen::Vector3i& box_nodes, const Eigen::Vector3f& half_extents) {
  FieldGrid grid;
  grid.nodes = box_nodes.array() + 2;
  grid.spacing = 2.0f * half_extents.cwiseQuotient((box_nodes.array() - 1).cast<float>().matrix());
  grid.origin = -half_extents - grid.spacing;
  grid.value.assign(grid.Index(0, 0, grid.nodes.z()), kBeyondBox);
  grid.edited.assign(grid.value.size(), 0);
  for (int z = 1; z <= box_nodes.z(); ++z) {
    for (int y = 1; y <= box_nodes.y(); ++y) std::fill_n(&grid.value[grid.Index(1, y, z)], box_nodes.x(), kEmpty);
  }
  return grid;
}

}  // namespace romap::mesh
