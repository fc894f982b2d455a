#include "server/mesh/marching_cubes_table.h"

#include <Eigen/Core>
#include <cassert>
#include <limits>
#include <vector>

namespace romap::mesh {
namespace {

// The corners of the six faces, counter-clockwise viewed from outside the cell.
constexpr int kFaceCorners[6][4] = {
    {0, 4, 6, 2}, {1, 3, 7, 5},  // x = 0, x = 1
    {0, 1, 5, 4}, {2, 6, 7, 3},  // y = 0, y = 1
    {0, 2, 3, 1}, {4, 5, 7, 6},  // z = 0, z = 1
};
constexpr int kNone = -1;

int EdgeBetween(int corner_a, int corner_b) {
  for (int edge = 0; edge < kCellEdges; ++edge) {
    const int low = EdgeCorner(edge);
    const int high = low | 1 << EdgeAxis(edge);
    if ((low == corner_a && high == corner_b) || (low == corner_b && high == corner_a)) return edge;
  }
  assert(false && "the corners have no common edge");
  return kNone;
}

bool Inside(int pattern, int corner) { return (pattern >> corner & 1) != 0; }

// next[e] = the cell edge that follows e on the surface's border, walked counter-clockwise viewed from outside the
// surface; kNone for edges that the surface does not cross.
std::array<int, kCellEdges> LinkEdges(int pattern) {
  std::array<int, kCellEdges> next;
  next.fill(kNone);
  for (const auto& face : kFaceCorners) {
    for (int start = 0; start < 4; ++start) {
      if (Inside(pattern, face[start]) || !Inside(pattern, face[(start + 1) % 4])) continue;
      // A run of inside corners starts after `start` and ends at `last`.
      int last = start + 1;
      while (Inside(pattern, face[(last + 1) % 4])) ++last;
      const int entry_edge = EdgeBetween(face[start], face[(start + 1) % 4]);
      const int exit_edge = EdgeBetween(face[last % 4], face[(last + 1) % 4]);
      next[entry_edge] = exit_edge;
    }
  }
  return next;
}

// Twice the midpoint of a cell edge, so that its coordinates are integers.
Eigen::Vector3i TwiceMidpoint(int edge) {
  const int corner = EdgeCorner(edge);
  Eigen::Vector3i midpoint(2 * (corner & 1), 2 * (corner >> 1 & 1), 2 * (corner >> 2 & 1));
  midpoint[EdgeAxis(edge)] = 1;
  return midpoint;
}

bool OnCommonFace(int edge_a, int edge_b) {
  const Eigen::Vector3i a = TwiceMidpoint(edge_a);
  const Eigen::Vector3i b = TwiceMidpoint(edge_b);
  for (int axis = 0; axis < 3; ++axis) {
    if (a[axis] == b[axis] && a[axis] != 1) return true;
  }
  return false;
}

// Triangulates a loop of cell edges with the shortest diagonals, none of which lies in a face of the cell.
class LoopTriangulation {
 public:
  explicit LoopTriangulation(const std::vector<int>& loop) : loop_(loop) {
    const int n = static_cast<int>(loop.size());
    cost_.assign(n, std::vector<double>(n, 0.0));
    apex_.assign(n, std::vector<int>(n, kNone));
    for (int span = 2; span < n; ++span) {
      for (int first = 0; first + span < n; ++first) TriangulatePart(first, first + span);
    }
  }

  void AppendTriangles(CellTriangles& triangles) const {
    const int last = static_cast<int>(loop_.size()) - 1;
    assert(cost_[0][last] < kForbidden && "every loop can be triangulated without diagonals in faces");
    Append(0, last, triangles);
  }

 private:
  static constexpr double kForbidden = 1e9;

  double DiagonalCost(int i, int j) const {
    const int n = static_cast<int>(loop_.size());
    if (j - i == 1 || j - i == n - 1) return 0;  // a side of the loop
    if (OnCommonFace(loop_[i], loop_[j])) return kForbidden;
    return (TwiceMidpoint(loop_[i]) - TwiceMidpoint(loop_[j])).cast<double>().norm();
  }

  // Best triangulation of the part of the loop from `first` to `last`, given those of all shorter parts.
  void TriangulatePart(int first, int last) {
    double best = std::numeric_limits<double>::infinity();
    for (int apex = first + 1; apex < last; ++apex) {
      const double cost = cost_[first][apex] + cost_[apex][last];
      if (cost < best) {
        best = cost;
        apex_[first][last] = apex;
      }
    }
    cost_[first][last] = best + DiagonalCost(first, last);
  }

  void Append(int first, int last, CellTriangles& triangles) const {
    if (last - first < 2) return;
    const int apex = apex_[first][last];
    triangles.Add(
        {static_cast<uint8_t>(loop_[first]), static_cast<uint8_t>(loop_[apex]), static_cast<uint8_t>(loop_[last])});
    Append(first, apex, triangles);
    Append(apex, last, triangles);
  }

  const std::vector<int>& loop_;
  std::vector<std::vector<double>> cost_;
  std::vector<std::vector<int>> apex_;
};

MarchingCubesTable BuildTable() {
  MarchingCubesTable table;
  for (int pattern = 0; pattern < 256; ++pattern) {
    std::array<int, kCellEdges> next = LinkEdges(pattern);
    for (int begin = 0; begin < kCellEdges; ++begin) {
      std::vector<int> loop;
      for (int edge = begin; next[edge] != kNone;) {
        loop.push_back(edge);
        const int following = next[edge];
        next[edge] = kNone;
        edge = following;
      }
      if (!loop.empty()) LoopTriangulation(loop).AppendTriangles(table[pattern]);
    }
  }
  return table;
}

}  // namespace

const MarchingCubesTable& GetMarchingCubesTable() {
  static const MarchingCubesTable& table = *new MarchingCubesTable(BuildTable());  // never destroyed
  return table;
}

}  // namespace romap::mesh
