#pragma once

#include <Eigen/Geometry>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "common/mesh.h"

namespace romap::texture {

// Whether every edge has two triangles with opposite directions, and the triangles of every vertex form one closed fan.
inline bool IsClosedSurface(const Mesh& mesh) {
  std::set<std::pair<uint32_t, uint32_t>> edges;
  std::vector<std::map<uint32_t, uint32_t>> after(mesh.vertices.size());  // the next vertex around a vertex
  for (const auto& triangle : mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      if (!edges.emplace(triangle[i], triangle[(i + 1) % 3]).second) return false;
      after[triangle[i]][triangle[(i + 1) % 3]] = triangle[(i + 2) % 3];
    }
  }
  for (const auto& [a, b] : edges) {
    if (!edges.contains({b, a})) return false;
  }
  for (const auto& around : after) {
    if (around.empty()) return false;
    size_t steps = 0;
    uint32_t at = around.begin()->first;
    do {
      at = around.at(at);
      ++steps;
    } while (at != around.begin()->first && steps <= around.size());
    if (steps != around.size()) return false;
  }
  return true;
}

// Positive if the triangles are counter-clockwise viewed from outside.
inline double EnclosedVolume(const Mesh& mesh) {
  double volume = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    volume += static_cast<double>(mesh.vertices[a].dot(mesh.vertices[b].cross(mesh.vertices[c]))) / 6;
  }
  return volume;
}

}  // namespace romap::texture
