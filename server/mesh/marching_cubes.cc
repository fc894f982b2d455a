#include "server/mesh/marching_cubes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "server/mesh/marching_cubes_table.h"

namespace romap {
namespace {

// Below level - kClampBelow raw means "nothing here" and its exact value says nothing about where the surface is.
constexpr float kClampBelow = 6.0f;
// Vertices keep this share of the edge away from its nodes, so that no two of them coincide.
constexpr float kNodeClearance = 1e-3f;

// Where on an edge from a node with raw `from` to one with raw `to` the level is crossed, 0..1.
float Crossing(float from, float to, float level) {
  if (to == kBeyondBoxRaw) return kNodeClearance;
  if (from == kBeyondBoxRaw) return 1.0f - kNodeClearance;
  const float lowest = level - kClampBelow;
  const float a = std::max(from, lowest);
  const float b = std::max(to, lowest);
  return std::clamp((level - a) / (b - a), kNodeClearance, 1.0f - kNodeClearance);
}

class Marcher {
 public:
  Marcher(const FieldGrid& grid, float level) : grid_(grid), level_(level) {
    for (int corner = 0; corner < kCellCorners; ++corner) {
      corner_offset_[corner] = (corner & 1) + (corner >> 1 & 1) * grid.StrideY() + (corner >> 2 & 1) * grid.StrideZ();
    }
    for (int edge = 0; edge < kCellEdges; ++edge) {
      edge_offset_[edge] = 3 * corner_offset_[EdgeCorner(edge)] + EdgeAxis(edge);
    }
  }

  Mesh Run() {
    inside_.resize(grid_.raw.size());
    for (size_t i = 0; i < inside_.size(); ++i) inside_[i] = grid_.raw[i] > level_;
    vertex_of_edge_.resize(3 * grid_.raw.size());
    const int cells = grid_.nodes_per_side - 1;
    for (int z = 0; z < cells; ++z) {
      for (int y = 0; y < cells; ++y) AddVerticesOfRow(y, z);
    }
    for (int z = 0; z < cells; ++z) {
      for (int y = 0; y < cells; ++y) AddTrianglesOfRow(y, z);
    }
    return std::move(mesh_);
  }

 private:
  // Edges in direction x, y, z of each node of the row. The last node of an axis is outside, as are its neighbours in
  // the outermost layer, so nothing is missed by leaving it out.
  void AddVerticesOfRow(int y, int z) {
    const std::array<size_t, 3> stride = {1, grid_.StrideY(), grid_.StrideZ()};
    size_t node = grid_.Index(0, y, z);
    for (int x = 0; x < grid_.nodes_per_side - 1; ++x, ++node) {
      for (int axis = 0; axis < 3; ++axis) {
        const size_t neighbour = node + stride[axis];
        if (inside_[node] == inside_[neighbour]) continue;
        Eigen::Vector3f at(x, y, z);
        at[axis] += Crossing(grid_.raw[node], grid_.raw[neighbour], level_);
        vertex_of_edge_[3 * node + axis] = static_cast<uint32_t>(mesh_.vertices.size());
        mesh_.vertices.push_back(grid_.Position(at));
      }
    }
  }

  void AddTrianglesOfRow(int y, int z) {
    const MarchingCubesTable& table = GetMarchingCubesTable();
    size_t node = grid_.Index(0, y, z);
    for (int x = 0; x < grid_.nodes_per_side - 1; ++x, ++node) {
      int pattern = 0;
      for (int corner = 0; corner < kCellCorners; ++corner) {
        pattern |= inside_[node + corner_offset_[corner]] << corner;
      }
      for (const auto& [a, b, c] : table[pattern]) {
        mesh_.triangles.push_back({VertexOn(node, a), VertexOn(node, b), VertexOn(node, c)});
      }
    }
  }

  uint32_t VertexOn(size_t node, int edge) const { return vertex_of_edge_[3 * node + edge_offset_[edge]]; }

  const FieldGrid& grid_;
  const float level_;
  std::array<size_t, kCellCorners> corner_offset_;  // of a cell's corners from its first node
  std::array<size_t, kCellEdges> edge_offset_;      // of a cell's edges in vertex_of_edge_ from its first node's
  std::vector<uint8_t> inside_;
  std::vector<uint32_t> vertex_of_edge_;  // three per node; set where the edge is crossed
  Mesh mesh_;
};

}  // namespace

Mesh MarchingCubes(const FieldGrid& grid, float level) { return Marcher(grid, level).Run(); }

void ComputeVertexNormals(Mesh& mesh) {
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

}  // namespace romap
