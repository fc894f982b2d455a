#include "common/mesh_components.h"

#include <cstdint>
#include <vector>

#include "common/disjoint_sets.h"

namespace romap {

size_t CountComponents(const Mesh& mesh) {
  DisjointSets sets(mesh.vertices.size());
  std::vector<bool> is_used(mesh.vertices.size());
  for (const auto& triangle : mesh.triangles) {
    for (const uint32_t vertex : triangle) {
      is_used[vertex] = true;
      sets.Join(vertex, triangle[0]);
    }
  }
  size_t components = 0;
  for (uint32_t vertex = 0; vertex < is_used.size(); ++vertex) {
    components += is_used[vertex] && sets.Root(vertex) == vertex ? 1 : 0;
  }
  return components;
}

}  // namespace romap
