#include "server/mesh/marching_cubes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <memory>
#include <utility>

#include "server/mesh/marching_cubes_table.h"

namespace romap::mesh {
namespace {

// Smaller values mean only that the node is empty; they do not indicate the distance to the surface.
constexpr float kClampBelow = -6.0f;

constexpr int kGroup = 8;  // nodes processed together: one word with one byte per node

// Calls visit(k) for each byte k of a word of flags that is 1.
template <class Visit>
void ForEachFlag(uint64_t flags, Visit visit) {
  for (; flags != 0; flags &= flags - 1) visit(std::countr_zero(flags) / 8);
}

// One pass over the nodes: creates the vertices on the edges that end at a node, then the triangles of the cell whose
// last corner it is. All edges of that cell end at this node or earlier ones.
class Marcher {
 public:
  explicit Marcher(const FieldGrid& grid)
      : grid_(grid),
        stride_{1, grid.StrideY(), grid.StrideZ()},
        inside_(grid.value.size() + kGroup, 0),
        vertex_of_edge_(std::make_unique_for_overwrite<uint32_t[]>(3 * grid.value.size())) {
    const size_t cell_size = stride_[0] + stride_[1] + stride_[2];
    for (int corner = 0; corner < kCellCorners; ++corner) {
      corner_back_[corner] = cell_size - ((corner & 1) + (corner >> 1 & 1) * stride_[1] + (corner >> 2) * stride_[2]);
    }
    for (int edge = 0; edge < kCellEdges; ++edge) {
      const int axis = EdgeAxis(edge);
      edge_back_[edge] = 3 * static_cast<ptrdiff_t>(corner_back_[EdgeCorner(edge)] - stride_[axis]) - axis;
    }
  }

  GridSurface Run() && {
    for (size_t i = 0; i < grid_.value.size(); ++i) inside_[i] = grid_.value[i] > 0;
    // The first node of each axis ends no edge and no cell.
    for (int z = 1; z < grid_.nodes.z(); ++z) {
      for (int y = 1; y < grid_.nodes.y(); ++y) {
        for (int x = 1; x < grid_.nodes.x(); x += kGroup) MarchGroup(x, y, z);
      }
    }
    return std::move(surface_);
  }

 private:
  uint64_t Flags(size_t node) const {
    uint64_t flags;
    std::memcpy(&flags, &inside_[node], sizeof(flags));
    return flags;
  }

  // The nodes (x .. x + 7, y, z), up to the end of the row.
  void MarchGroup(int x, int y, int z) {
    const size_t node = grid_.Index(x, y, z);
    // A flag is 0 or 1, so that the flags of all eight corners fit in one byte.
    uint64_t any = 0, all = ~uint64_t{0}, pattern = 0;
    for (int corner = 0; corner < kCellCorners; ++corner) {
      const uint64_t flags = Flags(node - corner_back_[corner]);
      any |= flags;
      all &= flags;
      pattern |= flags << corner;
    }
    uint64_t mixed = any & ~all;
    const int left = grid_.nodes.x() - x;
    if (left < kGroup) mixed &= (uint64_t{1} << 8 * left) - 1;
    if (mixed == 0) return;
    AddVertices(x, y, z, node);
    ForEachFlag(mixed, [&](int k) { AddTriangles(node + k, pattern >> 8 * k & 0xff); });
  }

  void AddVertices(int x, int y, int z, size_t group) {
    std::array<uint64_t, 3> crossed;
    for (int axis = 0; axis < 3; ++axis) crossed[axis] = Flags(group) ^ Flags(group - stride_[axis]);
    uint64_t any = crossed[0] | crossed[1] | crossed[2];
    const int left = grid_.nodes.x() - x;
    if (left < kGroup) any &= (uint64_t{1} << 8 * left) - 1;
    ForEachFlag(any, [&](int k) {
      const size_t node = group + k;
      for (int axis = 0; axis < 3; ++axis) {
        if ((crossed[axis] >> 8 * k & 1) == 0) continue;
        const size_t lower = node - stride_[axis];
        Eigen::Vector3f at(static_cast<float>(x + k), static_cast<float>(y), static_cast<float>(z));
        at[axis] -= 1.0f - EdgeCrossing(grid_.value[lower], grid_.value[node]);
        vertex_of_edge_[3 * node + axis] = static_cast<uint32_t>(surface_.mesh.vertices.size());
        surface_.mesh.vertices.push_back(grid_.Position(at));
        surface_.grid_edges.push_back(static_cast<uint32_t>(3 * lower + axis));
      }
    });
  }

  void AddTriangles(size_t last_node, size_t pattern) {
    const uint32_t* edges = &vertex_of_edge_[3 * last_node];
    for (const auto& [a, b, c] : table_[pattern]) {
      surface_.mesh.triangles.push_back({*(edges - edge_back_[a]), *(edges - edge_back_[b]), *(edges - edge_back_[c])});
    }
  }

  const FieldGrid& grid_;
  const MarchingCubesTable& table_ = GetMarchingCubesTable();
  const std::array<size_t, 3> stride_;
  std::array<size_t, kCellCorners> corner_back_;  // index step from a cell's last node back to each corner
  std::array<ptrdiff_t, kCellEdges> edge_back_;   // step in vertex_of_edge_ from a cell's last node to each edge
  std::vector<uint8_t> inside_;                   // by node, padded for the group that starts at the last node
  std::unique_ptr<uint32_t[]>
      vertex_of_edge_;  // by node and axis: the vertex on the edge that ends at the node; unset if not crossed
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

}  // namespace romap::mesh
