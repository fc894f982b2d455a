#pragma once

#include <string>

#include "common/mesh.h"
#include "common/status.h"

namespace romap::files {

// Reads positions and faces of a Wavefront OBJ file; polygons become fans, everything else is ignored. NOT_FOUND or
// INVALID_ARGUMENT with file and line.
absl::StatusOr<Mesh> ReadObj(const std::string& path);

}  // namespace romap::files
