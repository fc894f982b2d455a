#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace romap {

using Rgb8 = std::array<uint8_t, 3>;  // sRGB as in the source images, order R G B

// Triangle mesh; triangles are counter-clockwise viewed from outside. `normals`, `colors` and `confidence` are empty or
// as long as `vertices`. The owner of a mesh defines its frame (Object or World).
struct Mesh {
  std::vector<Eigen::Vector3f> vertices;  // map units
  std::vector<Eigen::Vector3f> normals;   // unit length
  std::vector<Rgb8> colors;
  // How well the views observed the vertex, 0..1: 0 = no view observed it, so its position is extrapolated. It
  // increases with the number of views, their resolution, and how directly they face the surface
  // (server/mesh/confidence.h).
  std::vector<float> confidence;
  std::vector<std::array<uint32_t, 3>> triangles;
};

}  // namespace romap
