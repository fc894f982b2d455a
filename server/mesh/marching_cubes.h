#pragma once

#include <cstdint>
#include <vector>

#include "common/mesh.h"
#include "server/mesh/field_grid.h"

namespace romap::mesh {

// A mesh with the grid edge that each vertex lies on.
struct GridSurface {
  Mesh mesh;                         // vertices and triangles only, in the Object frame, map units
  std::vector<uint32_t> grid_edges;  // by vertex: 3 * (index of the edge's lower node) + axis
};

// Vertices stay at least this share of a grid edge away from its nodes, so that no two vertices coincide.
inline constexpr float kNodeClearance = 1e-3f;

// Position at which the surface crosses an edge from a node of value `from` to one of value `to`, one of which is > 0:
// linear interpolation, as a share of the edge (0..1) clear of both nodes. Negative values are clamped to a few units
// below 0, because they are unbounded outside. On edges to the ring the surface lies on the box.
float EdgeCrossing(float from, float to);

// The surface where the value crosses 0 (inside: > 0), as a closed, consistently oriented 2-manifold without degenerate
// triangles (Lorensen and Cline, 1987; see GetMarchingCubesTable). Empty if no node is inside. The outermost nodes of
// the grid must be outside, and no value NaN.
GridSurface MarchingCubes(const FieldGrid& grid);

}  // namespace romap::mesh
