#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "client/files/mesh_file.h"
#include "common/geometry.h"
#include "common/mesh.h"
#include "common/status.h"

namespace romap::files {

// Reads a PLY file (Turk 1994): ASCII or binary of either byte order, with any scalar types and property order. x y z
// become vertices, nx ny nz normals, and red green blue (0..255) colors; `vertex_indices` polygons become triangle
// fans. All other vertex scalars, including confidence, are returned by name. Counts are validated before allocation.
// Errors as ReadMeshFile.
absl::StatusOr<MeshFile> ReadPly(const std::string& path);

// Parses a PLY file in memory. `name` prefixes the messages.
absl::StatusOr<MeshFile> ParsePly(std::string_view bytes, const std::string& name);

// Writes a binary little-endian PLY file: float x y z and, if present, float nx ny nz, uchar red green blue, float
// confidence, `scalars` (uchar if all values are integers in 0..255, otherwise float) and faces. INVALID_ARGUMENT: an
// invalid mesh (see ValidateMesh), arrays of different lengths, or confidence both in `mesh` and in `scalars`.
// Otherwise as WriteFile.
absl::Status WritePly(const std::string& path, const Mesh& mesh,
                      const std::map<std::string, std::vector<double>>& scalars = {});

// Writes a mesh in the World frame: as above without `scalars`, but with double x y z, because single precision would
// destroy the shape of a mesh far from the origin. MeshLab, CloudCompare, Open3D and Blender read both.
absl::Status WriteWorldPly(const std::string& path, const Mesh& mesh, const Sim3<World, Object>& S_world_mesh);

}  // namespace romap::files
