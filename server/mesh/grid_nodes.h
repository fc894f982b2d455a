#pragma once

#include <Eigen/Core>

#include "common/field_snapshot.h"
#include "server/mesh/mesh_config.h"

namespace romap::mesh {

// How many nodes the grid over a snapshot's box gets along each axis, each >= 2. The longest side gets
// config.resolution, or when that adapts, half to twice as many: one for each config.pixels_per_node that the side is
// long in a good view, because what a view cannot resolve the field cannot know. A field still in training gets no more
// than config.resolution: its mesh will soon be replaced. Shorter sides get so many that cells are cubes, but at least
// config.min_side_nodes.
Eigen::Vector3i ChooseNodes(const FieldSnapshot& snapshot, const MeshConfig& config);

}  // namespace romap::mesh
