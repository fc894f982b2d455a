#include "server/mesh/marching_cubes.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <utility>

#include "server/mesh/marching_cubes_table.h"

namespace romap {
namespace {

// Below, a value means "nothing here" and says nothing about where the surface is.
constexpr float kClampBelow = -6.0f;

constexpr int kGroup = 8;  // nodes whose flags are looked at together, as one word
constexpr uint64_t kAllInside = 0x0101010101010101;

class Marcher {
 public:
  explicit Marcher(const FieldGrid& grid)
      : grid_(grid),
        stride_{1, grid.StrideY(), grid.StrideZ()},
        vertex_of_edge_(std::make_unique_for_overwrite<uint32_t[]>(3 * grid.value.size())) {
    for (int corner = 0; corner < kCellCorners; ++corner) {
      corner_offset_[corner] = (corner & 1) + (corner >> 1 & 1) * stride_[1] + (corner >> 2 & 1) * stride_[2];
    }
    for (int edge = 0; edge < kCellEdges; ++edge) {
      edge_offset_[edge] = 3 * corner_offset_[EdgeCorner(edge)] + EdgeAxis(edge);
    }
  }

  GridSurface Run() && {
    // Groups at the end of the last row look a little beyond the last node.
    inside_.assign(grid_.value.size() + stride_[2] + stride_[1] + 2 * kGroup, 0);
    for (size_t i = 0; i < grid_.value.size(); ++i) inside_[i] = grid_.value[i] > 0;
    ForEachMixedGroup([this](int x, int y, int z, size_t node) { AddVertices(x, y, z, node); });
    surface_.mesh.triangles.reserve(2 * surface_.mesh.vertices.size());
    ForEachMixedGroup([this](int, int, int, size_t node) { AddTriangles(node); });
    return std::move(surface_);
  }

 private:
  uint64_t Flags(size_t node) const {
    uint64_t flags;
    std::memcpy(&flags, &inside_[node], sizeof(flags));
    return flags;
  }

  // Whether all corners of the group's cells agree.
  bool IsUniform(size_t node) const {
    uint64_t any = 0, all = kAllInside;
    for (const size_t offset : corner_offset_) {
      const uint64_t flags = Flags(node + offset);
      any |= flags;
      all &= flags;
    }
    return any == 0 || all == kAllInside;
  }

  // The last node of an axis is outside, as are its neighbours in the outermost layer, so nothing is missed by leaving
  // it out.
  template <class Visit>
  void ForEachMixedGroup(Visit visit) {
    const Eigen::Vector3i cells = grid_.nodes.array() - 1;
    for (int z = 0; z < cells.z(); ++z) {
      for (int y = 0; y < cells.y(); ++y) {
        const size_t row = grid_.Index(0, y, z);
        for (int x = 0; x < cells.x(); x += kGroup) {
          if (IsUniform(row + x)) continue;
          for (int k = x; k < std::min(x + kGroup, cells.x()); ++k) visit(k, y, z, row + k);
        }
      }
    }
  }

  // On the edges in direction x, y, z of a node.
  void AddVertices(int x, int y, int z, size_t node) {
    for (int axis = 0; axis < 3; ++axis) {
      const size_t neighbour = node + stride_[axis];
      if (inside_[node] == inside_[neighbour]) continue;
      Eigen::Vector3f at(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
      at[axis] += EdgeCrossing(grid_.value[node], grid_.value[neighbour]);
      const size_t edge = 3 * node + axis;
      vertex_of_edge_[edge] = static_cast<uint32_t>(surface_.mesh.vertices.size());
      surface_.mesh.vertices.push_back(grid_.Position(at));
      surface_.grid_edges.push_back(static_cast<uint32_t>(edge));
    }
  }

  void AddTriangles(size_t node) {
    int pattern = 0;
    for (int corner = 0; corner < kCellCorners; ++corner) pattern |= inside_[node + corner_offset_[corner]] << corner;
    for (const auto& [a, b, c] : table_[pattern]) {
      surface_.mesh.triangles.push_back({VertexOn(node, a), VertexOn(node, b), VertexOn(node, c)});
    }
  }

  uint32_t VertexOn(size_t node, int edge) const { return vertex_of_edge_[3 * node + edge_offset_[edge]]; }

  const FieldGrid& grid_;
  const MarchingCubesTable& table_ = GetMarchingCubesTable();
  const std::array<size_t, 3> stride_;
  std::array<size_t, kCellCorners> corner_offset_;  // of a cell's corners from its first node
  std::array<size_t, kCellEdges> edge_offset_;      // of a cell's edges in vertex_of_edge_ from its first node's
  std::vector<uint8_t> inside_;
  std::unique_ptr<uint32_t[]> vertex_of_edge_;  // three per node; set where the edge is crossed
  GridSurface surface_;
};

}  // namespace

float EdgeCrossing(float from, float to) {
  if (to == kBeyondBox) return kNodeClearance;
  if (from == kBeyondBox) return 1.0f - kNodeClearance;
  const float a = std::max(from, kClampBelow);
  const float b = std::max(to, kClampBelow);
  return std::clamp(a / (a - b), kNodeClearance, 1.0f - kNodeClearance);
}

GridSurface MarchingCubes(const FieldGrid& grid) { return Marcher(grid).Run(); }

}  // namespace romap
