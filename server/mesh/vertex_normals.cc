#include "server/mesh/vertex_normals.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <vector>

namespace romap {
namespace {

// Of a grid cell's sides, from the vertex to each place where the field is asked.
constexpr float kReach = 0.5f;
constexpr float kLeastAgreement = 0.5f;  // cosine between the field's normal and the triangles'
// Values beyond say "empty" or "full" and no longer how steep the surface is.
constexpr float kMostValue = 12.0f;

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
  points.reserve(6 * vertices.size());
  for (const uint32_t vertex : vertices) {
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3f offset = reach[axis] * Eigen::Vector3f::Unit(axis);
      points.push_back(mesh.vertices[vertex] + offset);
      points.push_back(mesh.vertices[vertex] - offset);
    }
  }
  std::vector<float> values(points.size());
  probe.Sample(points, values);
  for (float& value : values) value = std::clamp(value, -kMostValue, kMostValue);
  for (size_t i = 0; i < vertices.size(); ++i) {
    const float* around = &values[6 * i];
    const Eigen::Vector3f inwards =
        Eigen::Vector3f(around[0] - around[1], around[2] - around[3], around[4] - around[5]).cwiseQuotient(reach);
    const float length = inwards.norm();
    if (!(length > 0)) continue;
    const Eigen::Vector3f normal = -inwards / length;
    Eigen::Vector3f& of_area = mesh.normals[vertices[i]];
    if (normal.dot(of_area) >= kLeastAgreement) of_area = normal;
  }
}

}  // namespace romap
