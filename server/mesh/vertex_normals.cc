#include "server/mesh/vertex_normals.h"

#include <Eigen/Geometry>
#include <array>
#include <vector>

namespace romap {
namespace {

// Of a grid cell's sides, from the vertex to each place where the field is asked.
constexpr float kReach = 0.5f;
constexpr float kLeastAgreement = 0.5f;  // cosine between the field's normal and the triangles'
// Values beyond say "empty" or "full" and no longer how steep the surface is.
constexpr float kMostValue = 12.0f;

// Corners of a tetrahedron in a cube. Differences over its six edges cancel all even terms of the field.
constexpr std::array<std::array<float, 3>, 4> kTetrahedron = {{{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}}};

// Vertices whose edge ends with what the field itself says, on both sides.
std::vector<uint32_t> VerticesOfTheField(const FieldGrid& grid, const GridSurface& surface) {
  const std::array<size_t, 3> stride = {1, grid.StrideY(), grid.StrideZ()};
  std::vector<uint32_t> vertices;
  vertices.reserve(surface.grid_edges.size());
  for (size_t vertex = 0; vertex < surface.grid_edges.size(); ++vertex) {
    const size_t low = surface.grid_edges[vertex] / 3;
    const size_t high = low + stride[surface.grid_edges[vertex] % 3];
    const bool told = grid.value[low] > kEmpty && grid.value[high] > kEmpty;
    if (told && grid.edited[low] == 0 && grid.edited[high] == 0) vertices.push_back(static_cast<uint32_t>(vertex));
  }
  return vertices;
}

}  // namespace

void SetAreaNormals(Mesh& mesh) {
  mesh.normals.assign(mesh.vertices.size(), Eigen::Vector3f::Zero());
  for (const auto& [a, b, c] : mesh.triangles) {
    // Its length is twice the area: the weight comes for free.
    const Eigen::Vector3f normal = (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]);
    mesh.normals[a] += normal;
    mesh.normals[b] += normal;
    mesh.normals[c] += normal;
  }
  for (Eigen::Vector3f& normal : mesh.normals) {
    const float length = normal.norm();
    normal = length > 0 ? Eigen::Vector3f(normal / length) : Eigen::Vector3f::UnitZ();
  }
}

void SetFieldNormals(const FieldGrid& grid, const SurfaceProbe& probe, GridSurface& surface) {
  Mesh& mesh = surface.mesh;
  SetAreaNormals(mesh);
  const std::vector<uint32_t> vertices = VerticesOfTheField(grid, surface);
  const Eigen::Vector3f reach = kReach * grid.spacing;
  std::vector<Eigen::Vector3f> points;
  points.reserve(kTetrahedron.size() * vertices.size());
  for (const uint32_t vertex : vertices) {
    for (const auto& [x, y, z] : kTetrahedron) {
      points.push_back(mesh.vertices[vertex] + reach.cwiseProduct(Eigen::Vector3f(x, y, z)));
    }
  }
  std::vector<float> values(points.size());
  probe.Sample(points, values);
  for (size_t i = 0; i < vertices.size(); ++i) {
    Eigen::Vector3f inwards = Eigen::Vector3f::Zero();
    for (size_t corner = 0; corner < kTetrahedron.size(); ++corner) {
      const auto& [x, y, z] = kTetrahedron[corner];
      const float value = std::clamp(values[kTetrahedron.size() * i + corner], -kMostValue, kMostValue);
      inwards += value * Eigen::Vector3f(x, y, z);
    }
    inwards = inwards.cwiseQuotient(reach);
    const float length = inwards.norm();
    if (!(length > 0)) continue;
    const Eigen::Vector3f normal = -inwards / length;
    Eigen::Vector3f& of_area = mesh.normals[vertices[i]];
    if (normal.dot(of_area) >= kLeastAgreement) of_area = normal;
  }
}

}  // namespace romap
