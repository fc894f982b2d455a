#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "client/files/mesh_file.h"
#include "common/mesh.h"
#include "common/status.h"

namespace romap::files {

// Reads a PLY file (Turk 1994): ASCII, binary little or big endian; any scalar types and orders. x y z become vertices,
// nx ny nz normals, red green blue (0..255) colours, `vertex_indices` polygons fans of triangles; all further scalars
// of a vertex, confidence among them, are kept by name. NOT_FOUND or INVALID_ARGUMENT as ReadMeshFile; lengths are
// checked before memory is taken.
absl::StatusOr<MeshFile> ReadPly(const std::string& path);

// As ReadPly, on bytes in memory; `name` stands for the file in messages.
absl::StatusOr<MeshFile> ParsePly(std::string_view bytes, const std::string& name);

// Writes binary little endian: float x y z, and where present float nx ny nz, uchar red green blue, float
// confidence, the scalars (uchar where all are whole numbers of 0..255, else float), faces. INVALID_ARGUMENT when
// lengths do not fit, confidence comes twice or the disk refuses.
absl::Status WritePly(const std::string& path, const Mesh& mesh,
                      const std::map<std::string, std::vector<double>>& scalars = {});

}  // namespace romap::files
