#pragma once

#include <string>

#include "common/geometry.h"
#include "common/mesh.h"
#include "common/status.h"

namespace romap::files {

// Writes a mesh as one binary glTF 2.0 file (GLB).
//
// Vertices are stored unchanged, in the frame of the mesh; the transform of their node is S_world_mesh in double
// precision, so that a mesh far from the origin keeps its shape. The rotation of the parent node turns the z-up world
// into glTF's y-up frame. Colors are converted to linear space, as glTF requires, and stored as normalized 16-bit
// values (8 linear bits show banding). A mesh with `uv` and a texture gets the texture instead of the colors.
// Confidence is the attribute _CONFIDENCE. A mesh without triangles is written as a point cloud.
//
// INVALID_ARGUMENT: an invalid mesh (see ValidateMesh), a number of normals, colors, texture coordinates or
// confidences other than 0 or the number of vertices, or more than 4 GiB of data. Otherwise as WriteFile.
absl::Status WriteGlb(const std::string& path, const Mesh& mesh, const Sim3<World, Object>& S_world_mesh = {},
                      const MeshTexture& texture = {});

}  // namespace romap::files
