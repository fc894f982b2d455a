#include "client/eval/points.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>
#include <numeric>
#include <random>

#include "common/parallel_for.h"

namespace romap::eval {
namespace {

std::array<Eigen::Vector3d, 3> Corners(const Mesh& mesh, size_t triangle) {
  const auto& index = mesh.triangles[triangle];
  return {mesh.vertices[index[0]].cast<double>(), mesh.vertices[index[1]].cast<double>(),
          mesh.vertices[index[2]].cast<double>()};
}

// Prefix sums of the triangle areas.
std::vector<double> CumulativeAreas(const Mesh& mesh) {
  std::vector<double> areas(mesh.triangles.size());
  for (size_t k = 0; k < areas.size(); ++k) {
    const auto [a, b, c] = Corners(mesh, k);
    areas[k] = 0.5 * (b - a).cross(c - a).norm();
  }
  std::partial_sum(areas.begin(), areas.end(), areas.begin());
  return areas;
}

// The unit normal at a point of a triangle, given by the weights of its corners.
Eigen::Vector3d NormalAt(const Mesh& mesh, size_t triangle, const Eigen::Vector3d& weights) {
  if (mesh.normals.empty()) {
    const auto [a, b, c] = Corners(mesh, triangle);
    return (b - a).cross(c - a).normalized();
  }
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (int corner = 0; corner < 3; ++corner) {
    normal += weights[corner] * mesh.normals[mesh.triangles[triangle][static_cast<size_t>(corner)]].cast<double>();
  }
  return normal.normalized();
}

}  // namespace

absl::StatusOr<Points> SampleSurface(const Mesh& mesh, size_t count, uint32_t seed, const std::string& name) {
  ROMAP_ASSIGN_OR_RETURN(OrientedPoints samples, SampleOrientedSurface(mesh, count, seed, name));
  return std::move(samples.points);
}

absl::StatusOr<OrientedPoints> SampleOrientedSurface(const Mesh& mesh, size_t count, uint32_t seed,
                                                     const std::string& name) {
  OrientedPoints samples;
  if (mesh.triangles.empty()) {
    for (const Eigen::Vector3f& vertex : mesh.vertices) samples.points.push_back(vertex.cast<double>());
    for (const Eigen::Vector3f& normal : mesh.normals) samples.normals.push_back(normal.cast<double>().normalized());
    return samples;
  }
  const std::vector<double> areas = CumulativeAreas(mesh);
  if (!(areas.back() > 0)) return InvalidArgument("{}: the mesh has no area", name);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  samples.points.reserve(count);
  samples.normals.reserve(count);
  for (size_t k = 0; k < count; ++k) {
    const auto found = std::lower_bound(areas.begin(), areas.end(), uniform(random) * areas.back());
    const size_t triangle = std::min<size_t>(found - areas.begin(), areas.size() - 1);
    const auto [a, b, c] = Corners(mesh, triangle);
    const double r1 = std::sqrt(uniform(random));  // the square root makes the density uniform over the triangle
    const double r2 = uniform(random);
    const Eigen::Vector3d weights(1 - r1, r1 * (1 - r2), r1 * r2);
    samples.points.push_back(weights[0] * a + weights[1] * b + weights[2] * c);
    samples.normals.push_back(NormalAt(mesh, triangle, weights));
  }
  return samples;
}

struct NearestIndex::Tree {
  explicit Tree(const Points& points)
      : points(points), index(3, *this, nanoflann::KDTreeSingleIndexAdaptorParams(/*leaf_max_size=*/12)) {}

  // The data set interface of nanoflann.
  size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(size_t k, size_t axis) const { return points[k][static_cast<Eigen::Index>(axis)]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;  // let nanoflann compute it
  }

  const Points& points;
  nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Tree>, Tree, 3, uint32_t> index;
};

NearestIndex::NearestIndex(const Points& points) : tree_(std::make_unique<Tree>(points)) {}
NearestIndex::~NearestIndex() = default;
NearestIndex::NearestIndex(NearestIndex&&) noexcept = default;

Neighbors NearestIndex::Query(const Points& queries) const {
  Neighbors result{std::vector<uint32_t>(queries.size()), std::vector<double>(queries.size())};
  constexpr size_t kGrain = 512;  // queries per task
  ParallelForRanges(queries.size(), kGrain, [&](size_t begin, size_t end) {
    for (size_t k = begin; k < end; ++k) {
      double squared_distance = 0;
      tree_->index.knnSearch(queries[k].data(), 1, &result.index[k], &squared_distance);
      result.distance[k] = std::sqrt(squared_distance);
    }
  });
  return result;
}

}  // namespace romap::eval
