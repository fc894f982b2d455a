#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "common/mesh.h"
#include "common/mesh_components.h"

namespace romap::mesh {

struct Topology {
  size_t bad_edges = 0;     // directed edges that occur more than once, or whose opposite is missing
  size_t bad_vertices = 0;  // vertices whose triangles do not form one closed fan, or that have none
  size_t components = 0;
  long euler_characteristic = 0;

  bool IsClosedManifold() const { return bad_edges == 0 && bad_vertices == 0; }
};

// Follows the triangle fan around each vertex: successor[v][p] is the vertex after p around v.
inline Topology CheckTopology(const Mesh& mesh) {
  std::set<std::pair<uint32_t, uint32_t>> directed_edges;
  std::vector<std::map<uint32_t, uint32_t>> successor(mesh.vertices.size());
  Topology topology;
  for (const auto& triangle : mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      const uint32_t a = triangle[i];
      const uint32_t b = triangle[(i + 1) % 3];
      if (!directed_edges.emplace(a, b).second) ++topology.bad_edges;
      successor[a][b] = triangle[(i + 2) % 3];
    }
  }
  for (const auto& [a, b] : directed_edges) topology.bad_edges += !directed_edges.contains({b, a});
  for (const auto& around : successor) {
    size_t steps = 0;
    if (!around.empty()) {
      uint32_t at = around.begin()->first;
      do {
        const auto next = around.find(at);
        if (next == around.end()) break;
        at = next->second;
        ++steps;
      } while (at != around.begin()->first && steps <= around.size());
    }
    topology.bad_vertices += around.empty() || steps != around.size();
  }
  topology.components = CountComponents(mesh);
  topology.euler_characteristic = static_cast<long>(mesh.vertices.size()) -
                                  static_cast<long>(directed_edges.size() / 2) +
                                  static_cast<long>(mesh.triangles.size());
  return topology;
}

// Signed: positive when the triangles are counter-clockwise seen from outside.
inline double Volume(const Mesh& mesh) {
  double volume = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3d p = mesh.vertices[a].cast<double>();
    volume += p.dot(mesh.vertices[b].cast<double>().cross(mesh.vertices[c].cast<double>())) / 6;
  }
  return volume;
}

inline double Area(const Mesh& mesh) {
  double area = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3d u = (mesh.vertices[b] - mesh.vertices[a]).cast<double>();
    area += u.cross((mesh.vertices[c] - mesh.vertices[a]).cast<double>()).norm() / 2;
  }
  return area;
}

// Largest |distance(p)| over vertices and triangle centers.
template <class Distance>
double LargestDistance(const Mesh& mesh, Distance distance) {
  double largest = 0;
  for (const Eigen::Vector3f& p : mesh.vertices) largest = std::max<double>(largest, std::abs(distance(p)));
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3f center = (mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3.0f;
    largest = std::max<double>(largest, std::abs(distance(center)));
  }
  return largest;
}

}  // namespace romap::mesh
