#include "common/mesh_faces.h"

#include <algorithm>

#include "common/status.h"

namespace romap {

FaceShapes::FaceShapes(const Mesh& mesh) {
  center.reserve(mesh.triangles.size());
  normal.reserve(mesh.triangles.size());
  area_mu2.reserve(mesh.triangles.size());
  double total = 0;
  for (const auto& triangle : mesh.triangles) {
    const Eigen::Vector3f& a = mesh.vertices[triangle[0]];
    const Eigen::Vector3f& b = mesh.vertices[triangle[1]];
    const Eigen::Vector3f& c = mesh.vertices[triangle[2]];
    const Eigen::Vector3f cross = (b - a).cross(c - a);
    const float length = cross.norm();
    center.push_back((a + b + c) / 3.0f);
    normal.push_back(length > 0 ? Eigen::Vector3f(cross / length) : Eigen::Vector3f(Eigen::Vector3f::Zero()));
    area_mu2.push_back(length / 2);
    total += length / 2;
  }
  total_area_mu2 = static_cast<float>(total);
}

VertexTriangles::VertexTriangles(const Mesh& mesh) : first_(mesh.vertices.size() + 1, 0) {
  for (const auto& triangle : mesh.triangles) {
    for (const uint32_t vertex : triangle) ++first_[vertex + 1];
  }
  for (size_t k = 1; k < first_.size(); ++k) first_[k] += first_[k - 1];
  std::vector<uint32_t> next(first_.begin(), first_.end() - 1);
  triangles_.resize(3 * mesh.triangles.size());
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const uint32_t vertex : mesh.triangles[t]) triangles_[next[vertex]++] = t;
  }
}

Eigen::AlignedBox3f BoundsOf(const Mesh& mesh) {
  Eigen::AlignedBox3f bounds;
  for (const Eigen::Vector3f& vertex : mesh.vertices) bounds.extend(vertex);
  return bounds;
}

absl::Status ValidateMesh(const Mesh& mesh, const std::string& name) {
  if (mesh.vertices.empty()) return InvalidArgument("{}: no vertices", name);
  const auto broken = std::count_if(mesh.vertices.begin(), mesh.vertices.end(),
                                    [](const Eigen::Vector3f& vertex) { return !vertex.allFinite(); });
  if (broken > 0) return InvalidArgument("{}: {} vertices are not finite", name, broken);
  for (const auto& triangle : mesh.triangles) {
    for (const uint32_t index : triangle) {
      if (index < mesh.vertices.size()) continue;
      return InvalidArgument("{}: vertex index {} in a face is out of range 0..{}", name, index,
                             mesh.vertices.size() - 1);
    }
  }
  return absl::OkStatus();
}

}  // namespace romap
