#include "server/texture/manifold.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "common/disjoint_sets.h"

namespace romap::texture {
namespace {

using Triangle = std::array<uint32_t, 3>;

constexpr uint32_t kNoVertex = std::numeric_limits<uint32_t>::max();

// Removes triangles with less than three different vertices, and pairs that differ only in their orientation.
void RemoveFlat(std::vector<Triangle>& triangles) {
  std::erase_if(triangles, [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  // A triangle's vertices in ascending order, and whether that is its own orientation.
  struct Sorted {
    Triangle vertices;
    bool is_even;
    size_t index;
  };
  std::vector<Sorted> sorted;
  sorted.reserve(triangles.size());
  for (size_t i = 0; i < triangles.size(); ++i) {
    Triangle t = triangles[i];
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    const bool is_even = t[1] < t[2];
    if (!is_even) std::swap(t[1], t[2]);
    sorted.push_back({t, is_even, i});
  }
  std::sort(sorted.begin(), sorted.end(), [](const Sorted& a, const Sorted& b) {
    return a.vertices != b.vertices ? a.vertices < b.vertices : a.index < b.index;
  });
  std::vector<uint8_t> is_removed(triangles.size(), 0);
  for (size_t begin = 0; begin < sorted.size();) {
    size_t end = begin + 1;
    while (end < sorted.size() && sorted[end].vertices == sorted[begin].vertices) ++end;
    if (end - begin > 1) {
      std::array<std::vector<size_t>, 2> of_orientation;
      for (size_t i = begin; i < end; ++i) of_orientation[sorted[i].is_even ? 1 : 0].push_back(sorted[i].index);
      for (size_t i = 0; i < std::min(of_orientation[0].size(), of_orientation[1].size()); ++i) {
        is_removed[of_orientation[0][i]] = is_removed[of_orientation[1][i]] = 1;
      }
    }
    begin = end;
  }
  size_t at = 0;
  std::erase_if(triangles, [&](const Triangle&) { return is_removed[at++] != 0; });
}

// A half-edge between vertices in ascending order.
struct OrderedEdge {
  uint32_t low, high;
  uint32_t corner;  // 3 * triangle + corner where it begins
  bool is_forward;  // from `low` to `high`
};

uint32_t NextCorner(uint32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }

// Pairs the half-edges of one edge and joins the corners at their ends.
class EdgePairing {
 public:
  EdgePairing(std::span<const Eigen::Vector3f> vertices, std::span<const Triangle> triangles, DisjointSets& corners)
      : vertices_(vertices), triangles_(triangles), corners_(corners) {}

  void Pair(std::span<const OrderedEdge> edges) {
    if (edges.size() == 2) {
      if (edges[0].is_forward != edges[1].is_forward) Join(edges[0].corner, edges[1].corner);
      return;
    }
    // The solid is on the side of smaller angles of a forward triangle, and on the side of larger angles of a backward
    // one. So a forward triangle and the next backward one below it bound the same wedge.
    std::vector<uint8_t> is_paired(edges.size(), 0);
    for (const OrderedEdge& forward : edges) {
      if (!forward.is_forward) continue;
      const double angle = Angle(forward);
      size_t best = edges.size();
      double best_wedge = std::numeric_limits<double>::infinity();
      for (size_t i = 0; i < edges.size(); ++i) {
        if (edges[i].is_forward || is_paired[i] != 0) continue;
        const double turn = angle - Angle(edges[i]);
        const double wedge = turn < 0 ? turn + 2 * std::numbers::pi : turn;
        if (wedge >= best_wedge) continue;
        best_wedge = wedge;
        best = i;
      }
      if (best == edges.size()) return;
      is_paired[best] = 1;
      Join(forward.corner, edges[best].corner);
    }
  }

 private:
  void Join(uint32_t a, uint32_t b) {
    corners_.Join(a, NextCorner(b));
    corners_.Join(NextCorner(a), b);
  }

  // Of the triangle around the axis from `low` to `high`.
  double Angle(const OrderedEdge& edge) const {
    const Eigen::Vector3d from = vertices_[edge.low].cast<double>();
    const Eigen::Vector3d axis = (vertices_[edge.high].cast<double>() - from).normalized();
    const uint32_t opposite = NextCorner(NextCorner(edge.corner));
    const Eigen::Vector3d to = vertices_[triangles_[opposite / 3][opposite % 3]].cast<double>() - from;
    const Eigen::Vector3d x = axis.unitOrthogonal();
    return std::atan2(to.dot(axis.cross(x)), to.dot(x));
  }

  std::span<const Eigen::Vector3f> vertices_;
  std::span<const Triangle> triangles_;
  DisjointSets& corners_;
};

std::vector<OrderedEdge> SortedEdges(const std::vector<Triangle>& triangles) {
  std::vector<OrderedEdge> edges;
  edges.reserve(triangles.size() * 3);
  for (uint32_t corner = 0; corner < triangles.size() * 3; ++corner) {
    const uint32_t next = NextCorner(corner);
    const uint32_t from = triangles[corner / 3][corner % 3], to = triangles[next / 3][next % 3];
    edges.push_back({std::min(from, to), std::max(from, to), corner, from < to});
  }
  std::sort(edges.begin(), edges.end(), [](const OrderedEdge& a, const OrderedEdge& b) {
    if (a.low != b.low) return a.low < b.low;
    return a.high != b.high ? a.high < b.high : a.corner < b.corner;
  });
  return edges;
}

// Calls visit with the half-edges of each edge.
template <class Visit>
void ForEachEdge(const std::vector<OrderedEdge>& edges, const Visit& visit) {
  for (size_t begin = 0; begin < edges.size();) {
    size_t end = begin + 1;
    while (end < edges.size() && edges[end].low == edges[begin].low && edges[end].high == edges[begin].high) ++end;
    visit(std::span(edges).subspan(begin, end - begin));
    begin = end;
  }
}

}  // namespace

ManifoldTriangles MakeManifold(std::span<const Eigen::Vector3f> vertices, std::vector<Triangle> triangles) {
  RemoveFlat(triangles);
  DisjointSets corners(triangles.size() * 3);
  EdgePairing pairing(vertices, triangles, corners);
  ForEachEdge(SortedEdges(triangles), [&](std::span<const OrderedEdge> edges) { pairing.Pair(edges); });

  ManifoldTriangles result;
  result.triangles.resize(triangles.size());
  std::vector<uint32_t> vertex_of(triangles.size() * 3, kNoVertex);
  for (uint32_t corner = 0; corner < triangles.size() * 3; ++corner) {
    uint32_t& vertex = vertex_of[corners.Root(corner)];
    if (vertex == kNoVertex) {
      vertex = static_cast<uint32_t>(result.source.size());
      result.source.push_back(triangles[corner / 3][corner % 3]);
    }
    result.triangles[corner / 3][corner % 3] = vertex;
  }
  ForEachEdge(SortedEdges(result.triangles), [&](std::span<const OrderedEdge> edges) {
    result.is_manifold &= edges.size() == 1 || (edges.size() == 2 && edges[0].is_forward != edges[1].is_forward);
  });
  return result;
}

}  // namespace romap::texture
