#include "server/objects/isolation_forest.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "common/parallel_for.h"

namespace romap::objects {
namespace {

// Counter-based random numbers: splitmix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators",
// 2014).
class RandomStream {
 public:
  RandomStream(uint64_t seed, uint64_t stream) : state_(Mix(Mix(seed) + stream)) {}
  uint64_t Bits() { return Mix(state_ += kStep); }
  float Uniform() { return static_cast<float>(Bits() >> 40) * (1.0f / 16777216.0f); }
  // 0..n-1, from the high half of a product, which needs no division.
  uint32_t Below(uint32_t n) { return static_cast<uint32_t>(((Bits() >> 32) * n) >> 32); }
  Eigen::Vector3f InCube() {
    const float x = Uniform(), y = Uniform(), z = Uniform();
    return {x, y, z};
  }

 private:
  static constexpr uint64_t kStep = 0x9e3779b97f4a7c15ull;
  static uint64_t Mix(uint64_t x) {
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
    return x ^ (x >> 31);
  }
  uint64_t state_;
};

// A normal with uniform direction in space, or in a random coordinate plane or axis for lower extension levels.
Eigen::Vector3f DrawNormal(RandomStream& random, int extension_level) {
  Eigen::Vector3f normal;
  do {
    normal = 2.0f * random.InCube() - Eigen::Vector3f::Ones();
    std::array<int, 3> axes = {0, 1, 2};
    for (uint32_t left = 3; left > static_cast<uint32_t>(extension_level) + 1; --left) {
      std::swap(axes[random.Below(left)], axes[left - 1]);
      normal[axes[left - 1]] = 0;
    }
  } while (normal.squaredNorm() > 1 || normal.squaredNorm() < 1e-6f);
  return normal;
}

// Grows one tree into the given nodes.
class TreeGrower {
 public:
  TreeGrower(std::span<IsolationForest::Node> nodes, uint32_t first, int extension_level, RandomStream random)
      : nodes_(nodes), first_(first), extension_level_(extension_level), random_(random) {}

  void Grow(std::span<Eigen::Vector3f> points, uint32_t index, int depth, int depth_limit) {
    Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::infinity()), high = -low;
    for (const Eigen::Vector3f& p : points) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    IsolationForest::Node& node = nodes_[index];
    if (depth == depth_limit || points.size() <= 1 || low == high) {
      node = {.offset = std::numeric_limits<float>::infinity(),
              .child = first_ + index,
              .path_length = static_cast<float>(depth + MeanPathLength(points.size()))};
      return;
    }
    node.normal = DrawNormal(random_, extension_level_);
    node.offset = node.normal.dot(low + random_.InCube().cwiseProduct(high - low));
    const auto middle = std::partition(points.begin(), points.end(),
                                       [&](const Eigen::Vector3f& p) { return node.normal.dot(p) < node.offset; });
    const uint32_t child = used_;
    used_ += 2;
    node.child = first_ + child;
    const auto left = static_cast<size_t>(middle - points.begin());
    Grow(points.first(left), child, depth + 1, depth_limit);
    Grow(points.subspan(left), child + 1, depth + 1, depth_limit);
  }

 private:
  std::span<IsolationForest::Node> nodes_;
  uint32_t first_;  // index of nodes_[0] in the forest
  uint32_t used_ = 1;
  int extension_level_;
  RandomStream random_;
};

// Calls `body(i)` for each i < count, on several threads if the work takes more than about a millisecond: less work is
// finished before other threads have started.
template <class Body>
void ForEach(size_t count, size_t point_steps, const Body& body) {
  constexpr size_t kMinStepsForThreads = 1'000'000;
  if (point_steps < kMinStepsForThreads) {
    for (size_t i = 0; i < count; ++i) body(i);
  } else {
    ParallelFor(count, body);
  }
}

}  // namespace

double MeanPathLength(size_t n) {
  if (n <= 1) return 0;
  if (n == 2) return 1;  // exact value; the formula approximates the harmonic number
  const auto count = static_cast<double>(n);
  constexpr double kEulerGamma = 0.57721566490153286;
  return 2 * (std::log(count - 1) + kEulerGamma) - 2 * (count - 1) / count;
}

IsolationForest::IsolationForest(std::span<const Eigen::Vector3d> points, const IsolationForestOptions& options)
    : sample_size_(std::min(points.size(), static_cast<size_t>(std::max(1, options.sample_size)))) {
  if (points.empty()) return;
  const size_t trees = static_cast<size_t>(std::max(0, options.trees));
  depth_limit_ = static_cast<int>(std::ceil(std::log2(static_cast<double>(sample_size_))));
  center_ =
      std::accumulate(points.begin(), points.end(), Eigen::Vector3d(0, 0, 0)) / static_cast<double>(points.size());
  std::vector<Eigen::Vector3f> centered(points.size());
  for (size_t i = 0; i < points.size(); ++i) centered[i] = (points[i] - center_).cast<float>();

  // An empty side of a cut is also a leaf, so the number of nodes is bounded by the depth and not only by the number of
  // points.
  const size_t max_nodes =
      std::min((size_t{2} << depth_limit_) - 1, 2 * sample_size_ * static_cast<size_t>(depth_limit_) + 1);
  nodes_.resize(trees * max_nodes);
  roots_.resize(trees);
  const int level = std::clamp(options.extension_level, 0, 2);
  ForEach(trees, trees * sample_size_ * static_cast<size_t>(depth_limit_ + 1), [&](size_t tree) {
    roots_[tree] = static_cast<uint32_t>(tree * max_nodes);
    RandomStream random(options.seed, tree);
    std::vector<Eigen::Vector3f> sample = centered;
    for (size_t i = 0; i < sample_size_; ++i) {
      std::swap(sample[i], sample[i + random.Below(static_cast<uint32_t>(sample.size() - i))]);
    }
    const std::span<Node> tree_nodes = std::span<Node>(nodes_).subspan(tree * max_nodes, max_nodes);
    TreeGrower grower(tree_nodes, roots_[tree], level, random);
    grower.Grow(std::span<Eigen::Vector3f>(sample).first(sample_size_), 0, 0, depth_limit_);
  });
}

void IsolationForest::AddPaths(std::span<const Eigen::Vector3f> points, std::span<float> path_sums) const {
  constexpr size_t kBlock = 32;
  std::array<uint32_t, kBlock> at;
  for (const uint32_t root : roots_) {
    at.fill(root);
    for (int step = 0; step < depth_limit_; ++step) {
      for (size_t i = 0; i < points.size(); ++i) {
        const Node& node = nodes_[at[i]];
        at[i] = node.child + (node.normal.dot(points[i]) >= node.offset ? 1 : 0);
      }
    }
    for (size_t i = 0; i < points.size(); ++i) path_sums[i] += nodes_[at[i]].path_length;
  }
}

std::vector<double> IsolationForest::Scores(std::span<const Eigen::Vector3d> points) const {
  const double mean_path = MeanPathLength(sample_size_);
  std::vector<double> scores(points.size(), 0.5);
  if (roots_.empty() || !(mean_path > 0)) return scores;
  constexpr size_t kBlock = 32;
  const size_t steps = points.size() * roots_.size() * static_cast<size_t>(depth_limit_);
  ForEach((points.size() + kBlock - 1) / kBlock, steps, [&](size_t block) {
    const size_t first = block * kBlock, count = std::min(kBlock, points.size() - first);
    std::array<Eigen::Vector3f, kBlock> centered;
    std::array<float, kBlock> path_sums = {};
    for (size_t i = 0; i < count; ++i) centered[i] = (points[first + i] - center_).cast<float>();
    AddPaths(std::span<const Eigen::Vector3f>(centered).first(count), std::span<float>(path_sums).first(count));
    for (size_t i = 0; i < count; ++i) {
      scores[first + i] = std::exp2(-path_sums[i] / static_cast<double>(roots_.size()) / mean_path);
    }
  });
  return scores;
}

}  // namespace romap::objects
