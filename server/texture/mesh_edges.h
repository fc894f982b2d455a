#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "common/mesh.h"

namespace romap::texture {

inline constexpr uint32_t kNoFace = std::numeric_limits<uint32_t>::max();

using FaceNeighbors = std::array<uint32_t, 3>;

// The triangles across the edges of each triangle: element i is across the edge from corner i to corner i + 1. kNoFace
// if the edge is not shared by exactly two triangles with opposite directions.
std::vector<FaceNeighbors> FindFaceNeighbors(const std::vector<std::array<uint32_t, 3>>& triangles);

// Numbers of the vertices by position: vertices at the same position, such as copies in several charts, have the same
// number. The numbers begin at 0 without gaps.
std::vector<uint32_t> NumberByPosition(const Mesh& mesh);

// Sets unit vertex normals: the mean of the adjacent triangles' normals, weighted by the angle at the vertex, because
// the sizes of the triangles of a simplified mesh differ widely. Source: G. Thürmer and C. A. Wüthrich, "Computing
// vertex normals from polygonal facets", Journal of Graphics Tools 1998.
void SetAngleWeightedNormals(Mesh& mesh);

}  // namespace romap::texture
