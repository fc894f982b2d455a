#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace romap {

using Rgb8 = std::array<uint8_t, 3>;  // sRGB as in the source images, order R G B

// Triangle mesh; triangles are counter-clockwise viewed from outside. `normals`, `colors`, `confidence` and `uv` are
// empty or as long as `vertices`. The owner of a mesh defines its frame (Object or World).
struct Mesh {
  std::vector<Eigen::Vector3f> vertices;  // map units
  std::vector<Eigen::Vector3f> normals;   // unit length
  std::vector<Rgb8> colors;
  // How well the views observed the vertex, 0..1: 0 = no view observed it, so its position is extrapolated. It
  // increases with the number of views, their resolution, and how directly they face the surface
  // (server/mesh/confidence.h).
  std::vector<float> confidence;
  std::vector<std::array<uint32_t, 3>> triangles;
  // Position in the texture of the mesh: u to the right and v down, 0..1 from the upper left corner of the image to its
  // lower right one, as in glTF. Where parts of the texture meet, vertices occur twice at the same position.
  std::vector<Eigen::Vector2f> uv = {};
};

// The texture of a mesh with `uv`, as an image file. It replaces the colors of the vertices.
struct MeshTexture {
  std::string image;       // empty: none
  std::string media_type;  // image/png or image/jpeg
};

}  // namespace romap
