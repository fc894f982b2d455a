#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace romap {

using Rgb8 = std::array<uint8_t, 3>;  // sRGB as in the source images, order R G B

// Triangle mesh; counter-clockwise triangles seen from outside. `normals`, `colors` and `confidence` are empty or as
// long as `vertices`. The frame (Object or World) is the holder's to say.
struct Mesh {
  std::vector<Eigen::Vector3f> vertices;  // map units
  std::vector<Eigen::Vector3f> normals;   // unit length
  std::vector<Rgb8> colors;
  // How well the place was observed, 0..1: 0 = no view saw it, its shape is a guess; towards 1 with the number of
  // views, the straighter and the sharper they saw it (server/mesh/confidence.h).
  std::vector<float> confidence;
  std::vector<std::array<uint32_t, 3>> triangles;
};

}  // namespace romap
