#pragma once

#include <cstddef>
#include <vector>

#include "common/mesh.h"

namespace romap::texture {

struct SimplifyOptions {
  size_t max_triangles = 8000;
  // Edges are collapsed while the error stays below this distance, and further while the mesh has more than
  // max_triangles. Map units, >= 0.
  float max_error_mu = 0;
};

struct Simplified {
  Mesh mesh;
  // The largest distance by which a collapse moved the surface, estimated from quadrics [map units]: the root of the
  // mean square distance between the new vertex and the planes of the triangles that it replaces.
  float error_mu = 0;
};

// Simplifies a mesh by collapsing edges (M. Garland and P. S. Heckbert, "Surface simplification using quadric error
// metrics", SIGGRAPH 1997; meshoptimizer). The vertices of the result are vertices of `mesh` and keep their colors,
// confidence, texture coordinates and normals; normals that are absent are computed from the new triangles. A closed
// surface stays closed, and a manifold stays one except at a few edges with four triangles, where collapsed thin parts
// touch. Parts that collapse to nothing are removed. A mesh that cannot be simplified at all, such as a single
// triangle, is returned as it is, with normals. Vertices must be finite and triangles must refer to them.
Simplified SimplifyMesh(const Mesh& mesh, const SimplifyOptions& options);

// Up to two simpler versions of a mesh for views from afar, each with about a quarter of the triangles of the one
// before. Errors refer to `mesh`. Fewer if the mesh is small or cannot be simplified that much.
std::vector<Simplified> MakeLevels(const Mesh& mesh);

}  // namespace romap::texture
