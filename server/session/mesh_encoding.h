#pragma once

#include <absl/status/statusor.h>

#include "common/field_snapshot.h"
#include "common/map_events.h"
#include "server/mesh/mesh_config.h"

namespace romap::session {

// The mesh of a field as it is sent to clients, without a revision. The mesh of a field whose training is complete gets
// a texture, if config.texture is set and the views allow it; see texture::TextureMesh. Errors as mesh::ExtractMesh.
absl::StatusOr<MeshUpdate> MakeMeshUpdate(const FieldSnapshot& snapshot, const mesh::MeshConfig& config);

}  // namespace romap::session
