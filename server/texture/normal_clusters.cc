#include "server/texture/normal_clusters.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numeric>
#include <queue>
#include <tuple>

namespace romap::texture {
namespace {

// Only clusters of at least this share of the area have a center of their own.
constexpr float kMinCenterShare = 0.01f;
constexpr int kMovesOfCenters = 4;
// Passes of smoothing that tell flat regions, where clusters begin, from edges.
constexpr int kFlatnessPasses = 8;
// Cost of the distance from the center, relative to that of the angle, to keep clusters of flat regions compact.
constexpr float kDistanceCost = 0.15f;

class ClusterGrower {
 public:
  ClusterGrower(const Mesh& mesh, const std::vector<FaceNeighbors>& neighbors, const FaceShapes& shapes,
                const std::vector<Eigen::Vector3f>& normals)
      : mesh_(mesh), neighbors_(neighbors), shapes_(shapes), normals_(normals) {}

  // Grows clusters one after another, from flat regions.
  std::vector<uint32_t> GrowGreedily(float max_angle_rad) {
    const std::vector<Eigen::Vector3f> smooth = SmoothFaceNormals(neighbors_, shapes_, kFlatnessPasses);
    std::vector<uint32_t> order(mesh_.triangles.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
      return shapes_.normal[a].dot(smooth[a]) > shapes_.normal[b].dot(smooth[b]);
    });
    std::vector<uint32_t> of_face(mesh_.triangles.size(), kNoCluster);
    const float min_cosine = std::cos(max_angle_rad);
    for (const uint32_t seed : order) {
      if (of_face[seed] != kNoCluster) continue;
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      std::deque<uint32_t> open = {seed};
      of_face[seed] = clusters_;
      while (!open.empty()) {
        const uint32_t face = open.front();
        open.pop_front();
        sum += shapes_.area_mu2[face] * normals_[face];
        const float length = sum.norm();
        for (const uint32_t next : neighbors_[face]) {
          if (next == kNoFace || of_face[next] != kNoCluster || normals_[next].dot(sum) < min_cosine * length) continue;
          of_face[next] = clusters_;
          open.push_back(next);
        }
      }
      ++clusters_;
    }
    return of_face;
  }

  // The best triangle of each cluster that is large enough: it has a typical normal and is near the center.
  std::vector<uint32_t> Centers(const std::vector<uint32_t>& of_face, size_t clusters) {
    struct Sums {
      float area = 0;
      Eigen::Vector3f normal = Eigen::Vector3f::Zero(), center = Eigen::Vector3f::Zero();
      uint32_t best = kNoFace;
      float least_cost = std::numeric_limits<float>::infinity();
    };
    std::vector<Sums> sums(clusters);
    for (uint32_t face = 0; face < of_face.size(); ++face) {
      if (of_face[face] == kNoCluster) continue;
      Sums& of = sums[of_face[face]];
      of.area += shapes_.area_mu2[face];
      of.normal += shapes_.area_mu2[face] * normals_[face];
      of.center += shapes_.area_mu2[face] * shapes_.center[face];
    }
    for (uint32_t face = 0; face < of_face.size(); ++face) {
      if (of_face[face] == kNoCluster) continue;
      Sums& of = sums[of_face[face]];
      if (of.area < kMinCenterShare * shapes_.total_area_mu2 || !(of.area > 0)) continue;
      const float cost = 1 - normals_[face].dot(of.normal.normalized()) +
                         kDistanceCost * (shapes_.center[face] - of.center / of.area).squaredNorm() / of.area;
      if (cost < of.least_cost) std::tie(of.least_cost, of.best) = std::tie(cost, face);
    }
    std::vector<uint32_t> centers;
    normal_.clear();
    center_.clear();
    area_.clear();
    for (const Sums& of : sums) {
      if (of.best == kNoFace) continue;
      centers.push_back(of.best);
      normal_.push_back(of.normal.normalized());
      center_.push_back(of.center / of.area);
      area_.push_back(of.area);
    }
    return centers;
  }

  // Grows all clusters at the same time from their centers, the best triangles first.
  std::vector<uint32_t> GrowTogether(const std::vector<uint32_t>& centers) const {
    using Candidate = std::tuple<float, uint32_t, uint32_t>;  // cost, face, cluster
    std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> open;
    const auto push = [&](uint32_t face, uint32_t cluster) {
      const float cost = 1 - normals_[face].dot(normal_[cluster]) +
                         kDistanceCost * (shapes_.center[face] - center_[cluster]).squaredNorm() / area_[cluster];
      open.emplace(cost, face, cluster);
    };
    std::vector<uint32_t> of_face(mesh_.triangles.size(), kNoCluster);
    for (uint32_t cluster = 0; cluster < centers.size(); ++cluster) push(centers[cluster], cluster);
    while (!open.empty()) {
      const auto [cost, face, cluster] = open.top();
      open.pop();
      if (of_face[face] != kNoCluster) continue;
      of_face[face] = cluster;
      for (const uint32_t next : neighbors_[face]) {
        if (next != kNoFace && of_face[next] == kNoCluster) push(next, cluster);
      }
    }
    return of_face;
  }

  size_t Clusters() const { return clusters_; }

 private:
  const Mesh& mesh_;
  const std::vector<FaceNeighbors>& neighbors_;
  const FaceShapes& shapes_;
  const std::vector<Eigen::Vector3f>& normals_;
  uint32_t clusters_ = 0;
  // Of the clusters with a center:
  std::vector<Eigen::Vector3f> normal_, center_;
  std::vector<float> area_;
};

}  // namespace

std::vector<Eigen::Vector3f> SmoothFaceNormals(const std::vector<FaceNeighbors>& neighbors, const FaceShapes& shapes,
                                               int passes) {
  std::vector<Eigen::Vector3f> normals = shapes.normal;
  std::vector<Eigen::Vector3f> rough;
  for (int pass = 0; pass < passes; ++pass) {
    rough = normals;
    for (size_t face = 0; face < normals.size(); ++face) {
      Eigen::Vector3f sum = shapes.area_mu2[face] * rough[face];
      for (const uint32_t neighbor : neighbors[face]) {
        if (neighbor != kNoFace) sum += shapes.area_mu2[neighbor] * rough[neighbor];
      }
      const float length = sum.norm();
      if (length > 0) normals[face] = sum / length;
    }
  }
  return normals;
}

NormalClusters ClusterNormals(const Mesh& mesh, const std::vector<FaceNeighbors>& neighbors, const FaceShapes& shapes,
                              const std::vector<Eigen::Vector3f>& normals, float max_angle_rad) {
  ClusterGrower grower(mesh, neighbors, shapes, normals);
  NormalClusters result;
  result.of_face = grower.GrowGreedily(max_angle_rad);
  size_t clusters = grower.Clusters();
  for (int move = 0; move < kMovesOfCenters; ++move) {
    result.seed = grower.Centers(result.of_face, clusters);
    result.of_face = grower.GrowTogether(result.seed);
    clusters = result.seed.size();
  }
  return result;
}

}  // namespace romap::texture
