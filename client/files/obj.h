#pragma once

#include <string>

#include "client/files/mesh_file.h"
#include "common/status.h"

namespace romap::files {

// Reads the positions and faces of a Wavefront OBJ file. Polygons become triangle fans; everything else is ignored.
// INVALID_ARGUMENT names the file and the line or the face. Otherwise as ReadFile.
absl::StatusOr<MeshFile> ReadObj(const std::string& path);

}  // namespace romap::files
