#pragma once

#include "common/mesh.h"
#include "server/mesh/field_grid.h"

namespace romap {

// The surface where raw crosses `level` (inside: raw > level), as a closed, consistently oriented 2-manifold without
// degenerate triangles; vertices only, in the Object frame, map units. Empty when no node is inside. The outermost
// nodes of the grid must be outside, and no value NaN.
//
// A vertex sits on a grid edge where the linear interpolation of raw crosses the level. Raw is the logarithm of the
// density and falls without bound outside, so for the interpolation it is cut off a few units below the level. Towards
// the ring the vertex sits on the box.
Mesh MarchingCubes(const FieldGrid& grid, float level);

// Sets unit normals: the mean of the adjoining triangles' normals, weighted by area.
void ComputeVertexNormals(Mesh& mesh);

}  // namespace romap
