#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace romap::objects {

// Extended Isolation Forest: finds outliers as points that few random cuts separate from all others. Source: S. Hariri,
// M. Carrasco Kind, R. J. Brunner, "Extended Isolation Forest", IEEE TKDE 2021, which extends F. T. Liu, K. M. Ting,
// Z.-H. Zhou, "Isolation Forest", ICDM 2008. The RO-MAP paper removes outliers from the points of an object with it.

struct IsolationForestOptions {
  int trees = 50;
  // Points per tree, drawn without replacement (psi in the papers). The depth of a tree is limited to ceil(log2(psi)):
  // a point that is not isolated at that depth is not an outlier.
  int sample_size = 64;
  // Number of axes, in addition to the first one, along which the normal of a cut may have a component. 0: axis-aligned
  // cuts as in Liu et al., which give low scores to empty regions beside diagonal or multiple clusters. 2: cuts of any
  // orientation, which avoid this.
  int extension_level = 2;
  uint64_t seed = 1;
};

// c(n), the mean path length of an unsuccessful search in a binary search tree of `n` random keys; normalizes paths.
double MeanPathLength(size_t n);

// The trees, in one array of nodes. Immutable.
class IsolationForest {
 public:
  // A cut or a leaf of a tree. Child `child` of a cut has the points with normal . p < offset, child + 1 the others. A
  // leaf is its own child and has an infinite offset, so that a traversal of `depth_limit` steps ends in it.
  struct Node {
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    float offset = 0;
    uint32_t child = 0;
    float path_length = 0;  // of a leaf: its depth plus c(number of its points)
  };

  // Grows trees on `points` (finite, any unit). Every tree has its own random stream, so that equal input gives the
  // same forest with any number of threads.
  IsolationForest(std::span<const Eigen::Vector3d> points, const IsolationForestOptions& options);

  // Anomaly score of each point: 2^(-mean path length / c(sample size)), 0..1. About 0.5 for an ordinary point, near 1
  // for a point that one or two cuts isolate. 0.5 for all points of a forest of fewer than two.
  std::vector<double> Scores(std::span<const Eigen::Vector3d> points) const;

 private:
  // Adds the path lengths in all trees for up to one block of points. Points are traversed together, because a
  // traversal for one point would wait for memory at every step.
  void AddPaths(std::span<const Eigen::Vector3f> points, std::span<float> path_sums) const;

  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();  // nodes are in single precision, relative to it
  std::vector<Node> nodes_;
  std::vector<uint32_t> roots_;
  int depth_limit_ = 0;
  size_t sample_size_ = 0;
};

}  // namespace romap::objects
