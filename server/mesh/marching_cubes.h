#pragma once

#include <cstdint>
#include <vector>

#include "common/mesh.h"
#include "server/mesh/field_grid.h"

namespace romap::mesh {

// A mesh whose vertices know the grid edges they sit on.
struct GridSurface {
  Mesh mesh;                         // vertices and triangles only, in the Object frame, map units
  std::vector<uint32_t> grid_edges;  // by vertex: 3 * (index of the edge's lower node) + axis
};

// Vertices keep this share of a grid edge away from its nodes, so that no two of them coincide.
inline constexpr float kNodeClearance = 1e-3f;

// Where on an edge from a node of value `from` to one of value `to`, of which one is > 0, the surface is crossed if the
// value changes evenly, 0..1 and clear of the nodes. Values fall without bound outside; they are cut off a few units
// below 0. Towards the ring the surface sits on the box.
float EdgeCrossing(float from, float to);

// The surface where the value crosses 0 (inside: > 0), as a closed, consistently oriented 2-manifold without degenerate
// triangles (Lorensen and Cline, 1987; see GetMarchingCubesTable). Empty when no node is inside. The outermost nodes of
// the grid must be outside, and no value NaN.
GridSurface MarchingCubes(const FieldGrid& grid);

}  // namespace romap::mesh
