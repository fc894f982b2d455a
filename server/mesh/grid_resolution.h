#pragma once

#include <Eigen/Core>

#include "common/field_snapshot.h"
#include "server/mesh/mesh_config.h"

namespace romap::mesh {

// Number of grid nodes over a snapshot's box along each axis, each >= 2. The longest side gets config.resolution nodes.
// If config.adapt_resolution is on, it gets half to twice as many: one node for each config.pixels_per_node of the
// side's length in a well-resolved view, because the field cannot contain detail that no view resolves. While the field
// is still training the longest side gets at most config.resolution, because its mesh will soon be replaced. Shorter
// sides get nodes at the same spacing, but at least config.min_side_nodes.
Eigen::Vector3i ChooseNodes(const FieldSnapshot& snapshot, const MeshConfig& config);

}  // namespace romap::mesh
