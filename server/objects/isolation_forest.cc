#include "server/objects/isolation_forest.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace romap {
namespace {

// Mean path length of an unsuccessful search in a binary search tree of n nodes: the length that paths are measured by.
double MeanPathLength(size_t n) {
  if (n <= 1) return 0;
  if (n == 2) return 1;
  const auto count = static_cast<double>(n);
  constexpr double kEulerGamma = 0.5772156649;
  return 2 * (std::log(count - 1) + kEulerGamma) - 2 * (count - 1) / count;
}

class IsolationTree {
 public:
  IsolationTree(std::vector<Eigen::Vector3d> points, int max_depth, std::mt19937_64& random) {
    Grow(points, max_depth, random);
  }

  double PathLength(const Eigen::Vector3d& point) const {
    size_t index = 0;
    double length = 0;
    while (nodes_[index].left != 0) {
      index = nodes_[index].normal.dot(point) < nodes_[index].offset ? nodes_[index].left : nodes_[index].right;
      length += 1;
    }
    return length + nodes_[index].remaining_length;
  }

 private:
  struct Node {
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    double offset = 0;
    size_t left = 0;  // 0: a leaf
    size_t right = 0;
    double remaining_length = 0;  // expected steps to isolate what a leaf still holds together
  };

  size_t Grow(std::span<Eigen::Vector3d> points, int depth_left, std::mt19937_64& random) {
    const size_t index = nodes_.size();
    nodes_.push_back({.remaining_length = MeanPathLength(points.size())});
    if (depth_left == 0 || points.size() <= 1) return index;
    Eigen::Vector3d low = points[0];
    Eigen::Vector3d high = points[0];
    for (const Eigen::Vector3d& p : points) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform(0, 1);
    const Eigen::Vector3d slope(normal(random), normal(random), normal(random));
    const Eigen::Vector3d share(uniform(random), uniform(random), uniform(random));
    const double offset = slope.dot(low + share.cwiseProduct(high - low));
    const auto middle =
        std::partition(points.begin(), points.end(), [&](const Eigen::Vector3d& p) { return slope.dot(p) < offset; });
    const auto left_count = static_cast<size_t>(middle - points.begin());
    nodes_[index].normal = slope;
    nodes_[index].offset = offset;
    const size_t left = Grow(points.first(left_count), depth_left - 1, random);
    const size_t right = Grow(points.subspan(left_count), depth_left - 1, random);
    nodes_[index].left = left;
    nodes_[index].right = right;
    return index;
  }

  std::vector<Node> nodes_;
};

}  // namespace

std::vector<double> IsolationScores(std::span<const Eigen::Vector3d> points, const IsolationForestOptions& options) {
  std::vector<double> scores(points.size(), 0.5);
  if (points.size() < 4) return scores;
  std::mt19937_64 random(options.seed);
  const size_t sample_size = std::min(points.size(), static_cast<size_t>(options.sample_size));
  const int max_depth = static_cast<int>(std::ceil(std::log2(static_cast<double>(sample_size))));
  std::vector<double> path_sums(points.size(), 0);
  std::vector<Eigen::Vector3d> pool(points.begin(), points.end());
  for (int tree_index = 0; tree_index < options.trees; ++tree_index) {
    for (size_t i = 0; i < sample_size; ++i) std::swap(pool[i], pool[i + random() % (pool.size() - i)]);
    const IsolationTree tree({pool.begin(), pool.begin() + static_cast<std::ptrdiff_t>(sample_size)}, max_depth,
                             random);
    for (size_t i = 0; i < points.size(); ++i) path_sums[i] += tree.PathLength(points[i]);
  }
  for (size_t i = 0; i < points.size(); ++i) {
    scores[i] = std::exp2(-path_sums[i] / options.trees / MeanPathLength(sample_size));
  }
  return scores;
}

}  // namespace romap
