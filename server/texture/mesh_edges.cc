#include "server/texture/mesh_edges.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "common/mesh_faces.h"

namespace romap::texture {
namespace {

// Half an edge: the edge of one triangle, with its direction.
struct HalfEdge {
  uint32_t low, high;  // its vertices in ascending order
  uint32_t face;
  uint8_t corner;   // where it begins
  bool is_forward;  // from `low` to `high`
};

}  // namespace

std::vector<FaceNeighbors> FindFaceNeighbors(const std::vector<std::array<uint32_t, 3>>& triangles) {
  std::vector<HalfEdge> edges;
  edges.reserve(triangles.size() * 3);
  for (uint32_t face = 0; face < triangles.size(); ++face) {
    for (uint8_t corner = 0; corner < 3; ++corner) {
      const uint32_t from = triangles[face][corner], to = triangles[face][(corner + 1) % 3];
      edges.push_back({std::min(from, to), std::max(from, to), face, corner, from < to});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    if (a.low != b.low) return a.low < b.low;
    return a.high != b.high ? a.high < b.high : a.face < b.face;
  });
  std::vector<FaceNeighbors> neighbors(triangles.size(), {kNoFace, kNoFace, kNoFace});
  for (size_t begin = 0; begin < edges.size();) {
    size_t end = begin + 1;
    while (end < edges.size() && edges[end].low == edges[begin].low && edges[end].high == edges[begin].high) ++end;
    const HalfEdge &first = edges[begin], &last = edges[end - 1];
    if (end - begin == 2 && first.is_forward != last.is_forward) {
      neighbors[first.face][first.corner] = last.face;
      neighbors[last.face][last.corner] = first.face;
    }
    begin = end;
  }
  return neighbors;
}

std::vector<uint32_t> NumberByPosition(const Mesh& mesh) {
  std::vector<uint32_t> order(mesh.vertices.size());
  std::iota(order.begin(), order.end(), 0);
  const auto key = [&](uint32_t v) {
    return std::tuple(mesh.vertices[v].x(), mesh.vertices[v].y(), mesh.vertices[v].z());
  };
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return key(a) < key(b); });
  std::vector<uint32_t> numbers(mesh.vertices.size());
  uint32_t number = 0;
  for (size_t i = 0; i < order.size(); ++i) {
    if (i > 0 && key(order[i]) != key(order[i - 1])) ++number;
    numbers[order[i]] = number;
  }
  return numbers;
}

void SetAngleWeightedNormals(Mesh& mesh) {
  mesh.normals.assign(mesh.vertices.size(), Eigen::Vector3f::Zero());
  const FaceShapes shapes(mesh);
  for (size_t face = 0; face < mesh.triangles.size(); ++face) {
    for (int corner = 0; corner < 3; ++corner) {
      const Eigen::Vector3f& at = mesh.vertices[mesh.triangles[face][corner]];
      const Eigen::Vector3f u = mesh.vertices[mesh.triangles[face][(corner + 1) % 3]] - at;
      const Eigen::Vector3f v = mesh.vertices[mesh.triangles[face][(corner + 2) % 3]] - at;
      mesh.normals[mesh.triangles[face][corner]] += std::atan2(u.cross(v).norm(), u.dot(v)) * shapes.normal[face];
    }
  }
  for (Eigen::Vector3f& normal : mesh.normals) {
    const float length = normal.norm();
    normal = length > 0 ? Eigen::Vector3f(normal / length) : Eigen::Vector3f::UnitZ();
  }
}

}  // namespace romap::texture
