#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace romap::texture {

// Triangles over copies of vertices: vertex i is a copy of the vertex source[i].
struct ManifoldTriangles {
  std::vector<std::array<uint32_t, 3>> triangles;
  std::vector<uint32_t> source;
  // False if some edges still have more than two triangles, because both of their ends connect the same wedges.
  bool is_manifold = true;
};

// Makes a manifold of triangles that were collapsed from one. Collapsing edges of thin parts leaves triangles without
// area, pairs of opposite triangles, edges with four triangles, and vertices that two surfaces touch. The first two are
// removed. At the others, the surfaces are separated by copies of the vertices, such that each copy bounds one wedge of
// the solid (A. Guéziec et al., "Cutting and stitching: converting sets of polygons to manifold surfaces", TVCG 2001).
// Vertices without triangles are dropped. A closed surface stays closed, because collapsing keeps as many half-edges of
// each direction.
ManifoldTriangles MakeManifold(std::span<const Eigen::Vector3f> vertices,
                               std::vector<std::array<uint32_t, 3>> triangles);

}  // namespace romap::texture
