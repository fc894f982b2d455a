#pragma once

#include <cstddef>

#include "common/mesh.h"

namespace romap {

// Number of connected components of a mesh, by its triangles. Vertices without a triangle do not count.
size_t CountComponents(const Mesh& mesh);

}  // namespace romap
