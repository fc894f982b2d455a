#pragma once

#include "common/mesh.h"

namespace romap::fuzz {

// An octahedron with all values per vertex, for seeds.
inline Mesh SampleMesh() {
  Mesh mesh;
  mesh.vertices = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  mesh.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (size_t k = 0; k < mesh.vertices.size(); ++k) {
    const auto shade = static_cast<uint8_t>(40 * k);
    mesh.normals.push_back(mesh.vertices[k]);
    mesh.colors.push_back({shade, 100, 20});
    mesh.confidence.push_back(0.1F * static_cast<float>(k));
    mesh.uv.emplace_back(0.15F * static_cast<float>(k), 0.5F);
  }
  return mesh;
}

}  // namespace romap::fuzz
