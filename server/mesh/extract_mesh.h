#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstddef>

#include "common/field_snapshot.h"
#include "common/mesh.h"
#include "server/mesh/mesh_config.h"

namespace romap::mesh {

inline constexpr std::array kMeshPhaseNames = {"sample", "confirm", "hidden",  "support", "floaters",
                                               "march",  "refine",  "normals", "colors",  "confidence"};

// What one extraction cost.
struct MeshStats {
  std::array<double, kMeshPhaseNames.size()> phase_cpu_s = {};  // of the calling thread, by kMeshPhaseNames
  Eigen::Vector3i nodes = Eigen::Vector3i::Zero();              // of the grid over the box
  size_t asked_nodes = 0;                                       // at which the field was asked
};

// The surface of a trained field: a closed, coloured mesh with unit normals and confidence in the Object frame (map
// units), oriented outwards. Where the field leaves its box the surface closes along the box. With config.trim_unseen
// what no view saw is left out, and the mesh is open there.
//
// The field is sampled on a grid, what few views confirm goes, cavities and unseen space become solid, floaters go,
// marching cubes runs at the snapshot's surface level (paper, sections "System Overview" and "Implementation Details"),
// and its vertices move to where the field crosses that level.
//
// FAILED_PRECONDITION: the field nowhere rises above its surface level, or nothing of it was seen and unseen parts are
// to be trimmed. INVALID_ARGUMENT: a snapshot that cannot be (no field, box without volume, hull of another size than
// its resolution says, levels or optics that are not finite).
absl::StatusOr<Mesh> ExtractMesh(const FieldSnapshot& snapshot, const MeshConfig& config, MeshStats* stats = nullptr);

}  // namespace romap::mesh
