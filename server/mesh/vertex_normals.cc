#include "server/mesh/vertex_normals.h"

#include <Eigen/Geometry>
#include <utility>
#include <vector>

namespace romap::mesh {
namespace {

// More passes reduce the error a little further, but round off edges more and more.
constexpr int kSmoothingPasses = 2;

void Normalize(std::vector<Eigen::Vector3f>& normals) {
  for (Eigen::Vector3f& normal : normals) {
    const float length = normal.norm();
    normal = length > 0 ? Eigen::Vector3f(normal / length) : Eigen::Vector3f::UnitZ();
  }
}

}  // namespace

void SetVertexNormals(Mesh& mesh) {
  std::vector<Eigen::Vector3f>& normals = mesh.normals;
  normals.assign(mesh.vertices.size(), Eigen::Vector3f::Zero());
  for (const auto& [a, b, c] : mesh.triangles) {
    // The length of the cross product is twice the area, so the sum is weighted by area.
    const Eigen::Vector3f normal = (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]);
    normals[a] += normal;
    normals[b] += normal;
    normals[c] += normal;
  }
  Normalize(normals);
  std::vector<Eigen::Vector3f> rough(normals.size());
  for (int pass = 0; pass < kSmoothingPasses; ++pass) {
    std::swap(rough, normals);
    normals.assign(rough.size(), Eigen::Vector3f::Zero());
    for (const auto& [a, b, c] : mesh.triangles) {
      const Eigen::Vector3f sum = rough[a] + rough[b] + rough[c];
      normals[a] += sum;
      normals[b] += sum;
      normals[c] += sum;
    }
    Normalize(normals);
  }
}

}  // namespace romap::mesh
