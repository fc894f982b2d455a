#pragma once

#include <absl/status/statusor.h>

#include <span>
#include <string>

#include "common/geometry.h"
#include "common/mesh.h"

namespace romap {

// One mesh of a GLB file.
struct GlbObject {
  const Mesh* mesh = nullptr;  // required
  Sim3<World, Object> S_world_mesh = {};
  MeshTexture texture = {};  // used if the mesh has `uv`
  std::string name = "object";
};

// Encodes meshes as one binary glTF 2.0 file (GLB).
//
// Vertices are stored unchanged, in the frame of their mesh; the transform of its node is S_world_mesh in double
// precision, so that a mesh far from the origin keeps its shape. The rotation of the parent node turns the z-up world
// into glTF's y-up frame. Colors are converted to linear space, as glTF requires, and stored as normalized 16-bit
// values (8 linear bits show banding). A mesh with `uv` and a texture gets the texture instead of the colors.
// Confidence is the attribute _CONFIDENCE. A mesh without triangles is written as a point cloud.
//
// INVALID_ARGUMENT, with `name` at the beginning of the message: an invalid mesh (see ValidateMesh), a number of
// normals, colors, texture coordinates or confidences other than 0 or the number of vertices, or more than 4 GiB of
// data.
absl::StatusOr<std::string> EncodeGlb(std::span<const GlbObject> objects, const std::string& name);

}  // namespace romap
