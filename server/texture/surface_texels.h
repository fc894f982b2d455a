#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "server/texture/unwrap_mesh.h"

namespace romap::texture {

// A texel that shows a point of the surface (Object frame, map units).
struct SurfaceTexel {
  uint32_t index = 0;           // row * atlas_px + column
  uint32_t face = 0;            // of the mesh
  Eigen::Vector3f barycentric;  // negative beside a chart where the surface is continued
  Eigen::Vector3f position;
  Eigen::Vector3f normal;  // unit length, between that of the triangle and that interpolated from its vertices
};

// The texels whose centers are in a triangle, and those up to two texels beside a chart, because interpolation at the
// border of a chart reads them. Beside a chart, the surface is continued in the plane of the triangle; where the next
// triangle of the mesh has another direction, the texel shows the nearest point of the edge instead. Ordered by tiles,
// so that texels that follow each other are neighbors in the views, whose pixels then stay in the cache.
std::vector<SurfaceTexel> FindSurfaceTexels(const TexturedMesh& textured);

}  // namespace romap::texture
