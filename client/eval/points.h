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

// `count` points on the triangles of a mesh, uniform over its area; a mesh without triangles is a point cloud and gives
// all its vertices. The same seed gives the same points. INVALID_ARGUMENT naming `name`: the mesh has no area.
absl::StatusOr<Points> SampleSurface(const Mesh& mesh, size_t count, uint32_t seed, const std::string& name);

// Points at the given positions of `points`.
Points Take(const Points& points, const std::vector<uint32_t>& indices);

// For each query point its nearest neighbour among the points of an index.
struct Neighbours {
  std::vector<uint32_t> index;
  std::vector<double> distance;  // in the unit of the points
};

// Nearest-neighbour search in a fixed set of points (k-d tree). Safe to share between threads.
class NearestIndex {
 public:
  // `points` must not be empty and must outlive the index.
  explicit NearestIndex(const Points& points);
  ~NearestIndex();
  NearestIndex(NearestIndex&&) noexcept;

  // Runs on all threads of the calling task arena.
  Neighbours Query(const Points& queries) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace romap::eval
