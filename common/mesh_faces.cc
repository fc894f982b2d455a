#include "common/mesh_faces.h"

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

Eigen::AlignedBox3f BoundsOf(const Mesh& mesh) {
  Eigen::AlignedBox3f bounds;
  for (const Eigen::Vector3f& vertex : mesh.vertices) bounds.extend(vertex);
  return bounds;
}

}  // namespace romap
