#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "common/mesh.h"

namespace romap {

// The triangles of a mesh, as far as they follow from its vertices.
struct FaceShapes {
  std::vector<Eigen::Vector3f> center;
  std::vector<Eigen::Vector3f> normal;  // unit length, outward for counter-clockwise triangles; zero without area
  std::vector<float> area_mu2;          // square map units
  float total_area_mu2 = 0;

  explicit FaceShapes(const Mesh& mesh);
};

// The bounding box of the vertices; empty without vertices.
Eigen::AlignedBox3f BoundsOf(const Mesh& mesh);

}  // namespace romap
