#pragma once

#include <optional>

#include "common/map_events.h"
#include "common/mesh.h"

namespace romap::mesh {

// Finds the direction from which a further view would show most of the surface that the views so far observed badly.
// Candidates are directions around the object from 15 to 75 degrees above its horizontal plane (Object frame, z up),
// because objects usually stand on something. A vertex counts if it faces the candidate and no other part of the mesh
// hides it; its weight is what its confidence lacks, times the cosine between its normal and the direction.
//
// The mesh needs normals and confidence, and vertices that are evenly spread over its surface. nullopt: no candidate
// would add a noticeable share of the surface.
std::optional<NextView> FindNextView(const Mesh& mesh);

}  // namespace romap::mesh
