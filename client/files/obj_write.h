#pragma once

#include <string>

#include "common/geometry.h"
#include "common/mesh.h"
#include "common/status.h"

namespace romap::files {

// Writes a mesh as a Wavefront OBJ file in the World frame, for programs that read no glTF. `path` ends with ".obj". If
// the mesh has a texture, it is written beside the file, with a material library that names it: "a.obj", "a.mtl" and
// "a.jpg" or "a.png". Otherwise colors follow the coordinates of each vertex, as many programs read them.
//
// INVALID_ARGUMENT: an invalid mesh (see ValidateMesh), a number of normals, colors or texture coordinates other than 0
// or the number of vertices, or another texture than PNG and JPEG. Otherwise as WriteFile.
absl::Status WriteObj(const std::string& path, const Mesh& mesh, const Sim3<World, Object>& S_world_mesh = {},
                      const MeshTexture& texture = {});

}  // namespace romap::files
