#pragma once

#include <absl/status/statusor.h>

#include "common/mesh.h"
#include "common/messages.h"
#include "server/mesh/mesh_config.h"

namespace romap {

// The surface of a trained field: a closed, coloured mesh with unit normals in the Object frame (map units), oriented
// outwards. Where the field leaves its box the surface closes along the box.
//
// The raw values are sampled on a grid, cavities and unseen space become solid, floaters go, and marching cubes runs at
// the snapshot's surface level (paper, sections "System Overview" and "Implementation Details").
//
// FAILED_PRECONDITION: the field nowhere rises above its surface level. INVALID_ARGUMENT: a snapshot that cannot be
// (no field, box without volume, hull of another size than its resolution says, a level that is not finite).
absl::StatusOr<Mesh> ExtractMesh(const FieldSnapshot& snapshot, const MeshConfig& config);

}  // namespace romap
