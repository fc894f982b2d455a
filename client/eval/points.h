#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "common/mesh.h"
#include "common/status.h"

namespace romap::eval {

using Points = std::vector<Eigen::Vector3d>;

// Samples `count` points on the triangles of a mesh, uniformly by area and reproducibly for a seed. Returns all
// vertices of a mesh without triangles (a point cloud). INVALID_ARGUMENT if the mesh has no area; `name` prefixes the
// message.
absl::StatusOr<Points> SampleSurface(const Mesh& mesh, size_t count, uint32_t seed, const std::string& name);

// Points of a surface and its unit normals there, outward.
struct OrientedPoints {
  Points points;
  Points normals;  // as many, or none if the normals are not known
};

// The same points with the normals: interpolated if the mesh has normals of its vertices, otherwise those of the
// triangles. A point cloud has those of its file, or none.
absl::StatusOr<OrientedPoints> SampleOrientedSurface(const Mesh& mesh, size_t count, uint32_t seed,
                                                     const std::string& name);

// The nearest neighbors of a list of query points.
struct Neighbors {
  std::vector<uint32_t> index;   // into the points of the index
  std::vector<double> distance;  // in the unit of the points
};

// Nearest-neighbor search in a fixed set of points (k-d tree). Thread-safe.
class NearestIndex {
 public:
  // `points` must not be empty and must outlive the index.
  explicit NearestIndex(const Points& points);
  ~NearestIndex();
  NearestIndex(NearestIndex&&) noexcept;

  // Runs in parallel on the calling task arena.
  Neighbors Query(const Points& queries) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace romap::eval
