#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstddef>

#include "common/field_snapshot.h"
#include "common/mesh.h"
#include "server/mesh/mesh_config.h"

namespace romap::mesh {

inline constexpr std::array kMeshPhaseNames = {"sample", "hidden",  "base",   "floaters",  "march",
                                               "refine", "normals", "colors", "confidence"};

// The cost of one extraction.
struct MeshStats {
  std::array<double, kMeshPhaseNames.size()> phase_cpu_s = {};  // of the calling thread, by kMeshPhaseNames
  Eigen::Vector3i nodes = Eigen::Vector3i::Zero();              // of the grid over the box
  size_t sampled_nodes = 0;                                     // nodes at which the field was evaluated
};

// The surface of a trained field: a closed, colored mesh with unit normals and confidence in the Object frame (map
// units), oriented outward. Where the field extends beyond its box, the surface is closed at the box. With
// config.trim_unseen the parts of the surface that no view observed are removed, so the mesh is open there.
//
// Steps: sample the field on a grid, fill cavities and invisible space, cut below the visible base, remove floaters,
// extract the snapshot's surface level by marching cubes (paper, sections "System Overview" and "Implementation
// Details"), and move the vertices to where the field crosses that level.
//
// FAILED_PRECONDITION: the field is nowhere above its surface level, or config.trim_unseen is set and no view observed
// the surface. INVALID_ARGUMENT: the snapshot is invalid (no field, box without volume, size of the hull differs from
// its resolution, levels or optics not finite).
absl::StatusOr<Mesh> ExtractMesh(const FieldSnapshot& snapshot, const MeshConfig& config, MeshStats* stats = nullptr);

}  // namespace romap::mesh
