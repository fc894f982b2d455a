#include "common/mesh_components.h"

#include <cstdint>
#include <numeric>
#include <vector>

namespace romap {

size_t CountComponents(const Mesh& mesh) {
  // Union-find with path halving.
  std::vector<uint32_t> parent(mesh.vertices.size());
  std::iota(parent.begin(), parent.end(), 0u);
  const auto root_of = [&](uint32_t vertex) {
    while (parent[vertex] != vertex) vertex = parent[vertex] = parent[parent[vertex]];
    return vertex;
  };
  std::vector<bool> is_used(parent.size());
  for (const auto& triangle : mesh.triangles) {
    for (const uint32_t vertex : triangle) {
      is_used[vertex] = true;
      parent[root_of(vertex)] = root_of(triangle[0]);
    }
  }
  size_t components = 0;
  for (uint32_t vertex = 0; vertex < parent.size(); ++vertex) {
    components += is_used[vertex] && parent[vertex] == vertex ? 1 : 0;
  }
  return components;
}

}  // namespace romap
