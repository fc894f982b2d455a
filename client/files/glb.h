#pragma once

#include <string>

#include "common/geometry.h"
#include "common/mesh.h"
#include "common/status.h"

namespace romap::files {

// Writes a mesh as a GLB file, see EncodeGlb() (common/gltf/glb.h) for its contents and errors. Otherwise as WriteFile.
absl::Status WriteGlb(const std::string& path, const Mesh& mesh, const Sim3<World, Object>& S_world_mesh = {},
                      const MeshTexture& texture = {});

}  // namespace romap::files
