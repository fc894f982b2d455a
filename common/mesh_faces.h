#pragma once

#include <absl/status/status.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
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

// The triangles at each vertex, in the order of the mesh.
class VertexTriangles {
 public:
  explicit VertexTriangles(const Mesh& mesh);

  // Indices of triangles.
  std::span<const uint32_t> At(size_t vertex) const {
    return std::span(triangles_).subspan(first_[vertex], first_[vertex + 1] - first_[vertex]);
  }

 private:
  std::vector<uint32_t> first_;  // by vertex, into `triangles_`; one more than vertices
  std::vector<uint32_t> triangles_;
};

// The bounding box of the vertices; empty without vertices.
Eigen::AlignedBox3f BoundsOf(const Mesh& mesh);

// INVALID_ARGUMENT if the mesh has no vertices, a vertex that is not finite, or a triangle with a vertex index out of
// range. `name` prefixes the message.
absl::Status ValidateMesh(const Mesh& mesh, const std::string& name);

}  // namespace romap
