#include "server/mesh/filtered_normals.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <vector>

#include "common/mesh_faces.h"

namespace romap::mesh {
namespace {

constexpr int kPasses = 10;
// Standard deviation of the difference of the unit normals of two triangles that counts as noise.
constexpr float kNoise = 0.5f;

// About exp(-x) for x >= 0; several times faster than std::exp.
float Falloff(float x) {
  if (x > 8.0f) return 0;
  const float y = 1.0f / (1.0f + x * (0.125f + x * (1.0f / 128.0f)));
  const float y2 = y * y, y4 = y2 * y2;
  return y4 * y4;
}

// Each triangle with the triangles that share a vertex with it.
struct Neighborhoods {
  std::vector<uint32_t> first = {0};  // by triangle: index of its first neighbor; one more than triangles
  std::vector<uint32_t> neighbor = {};
  std::vector<float> weight = {};  // by neighbor: of its area and distance
};

Neighborhoods FindNeighborhoods(const Mesh& mesh, const VertexTriangles& at_vertex, const FaceShapes& shapes) {
  Neighborhoods found;
  std::vector<uint32_t> visited_by(mesh.triangles.size(), UINT32_MAX);
  double sum_mu = 0;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    visited_by[t] = t;
    for (const uint32_t vertex : mesh.triangles[t]) {
      for (const uint32_t other : at_vertex.At(vertex)) {
        if (visited_by[other] == t) continue;
        visited_by[other] = t;
        found.neighbor.push_back(other);
        found.weight.push_back((shapes.center[t] - shapes.center[other]).norm());
        sum_mu += found.weight.back();
      }
    }
    found.first.push_back(static_cast<uint32_t>(found.neighbor.size()));
  }
  const double mean_mu = sum_mu / std::max<double>(1, static_cast<double>(found.neighbor.size()));
  const float per_distance = mean_mu > 0 ? static_cast<float>(0.5 / (mean_mu * mean_mu)) : 0;
  for (size_t k = 0; k < found.weight.size(); ++k) {
    found.weight[k] = shapes.area_mu2[found.neighbor[k]] * Falloff(found.weight[k] * found.weight[k] * per_distance);
  }
  return found;
}

std::vector<Eigen::Vector3f> FilterNormals(const Mesh& mesh, const VertexTriangles& at_vertex,
                                           const FaceShapes& shapes) {
  const Neighborhoods around = FindNeighborhoods(mesh, at_vertex, shapes);
  constexpr float kPerDifference = 0.5f / (kNoise * kNoise);
  std::vector<Eigen::Vector3f> normals = shapes.normal, filtered = normals;
  for (int pass = 0; pass < kPasses; ++pass) {
    for (size_t t = 0; t < normals.size(); ++t) {
      Eigen::Vector3f sum = shapes.area_mu2[t] * normals[t];
      for (uint32_t k = around.first[t]; k < around.first[t + 1]; ++k) {
        const Eigen::Vector3f& other = normals[around.neighbor[k]];
        sum += around.weight[k] * Falloff((normals[t] - other).squaredNorm() * kPerDifference) * other;
      }
      const float length = sum.norm();
      if (length > 0) filtered[t] = sum / length;
    }
    normals.swap(filtered);
  }
  return normals;
}

}  // namespace

void SetFilteredNormals(Mesh& mesh) {
  const VertexTriangles at_vertex(mesh);
  const FaceShapes shapes(mesh);
  const std::vector<Eigen::Vector3f> normals = FilterNormals(mesh, at_vertex, shapes);
  mesh.normals.assign(mesh.vertices.size(), Eigen::Vector3f::UnitZ());
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (const uint32_t t : at_vertex.At(v)) sum += shapes.area_mu2[t] * normals[t];
    if (sum.norm() > 0) mesh.normals[v] = sum.normalized();
  }
}

}  // namespace romap::mesh
