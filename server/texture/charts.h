#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "common/mesh.h"

namespace romap::texture {

// A part of a mesh that is projected onto a plane without overlap (PlaneProjection of `normal`).
struct Chart {
  Eigen::Vector3f normal;       // unit length
  std::vector<uint32_t> faces;  // indices of triangles; together they are connected by edges
};

struct ChartOptions {
  // The largest angle between the plane's normal and the smoothed normals of the triangles that a chart grows from.
  // Single triangles may deviate by up to kMaxFaceAngle_rad, because the surface is noisy.
  float max_angle_rad = 0.95f;
  // Smaller charts are merged with their neighbors if possible. Share of the mesh's area.
  float min_area_share = 0.004f;
};

inline constexpr float kMaxFaceAngle_rad = 1.4f;

// Divides the triangles of a mesh into charts. Clusters of similar normals are found by growing regions and moving
// their centers (D. Cohen-Steiner, P. Alliez and M. Desbrun, "Variational shape approximation", SIGGRAPH 2004). Then
// triangles whose projection would be reversed or overlap another one move to neighboring charts or to new ones.
// Every triangle belongs to one chart; triangles without area belong to any chart next to them.
std::vector<Chart> DivideIntoCharts(const Mesh& mesh, const ChartOptions& options);

}  // namespace romap::texture
