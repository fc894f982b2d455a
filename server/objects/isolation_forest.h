#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace romap::objects {

// Extended Isolation Forest: finds lonely points by how few random cuts part them from all others. Source: S. Hariri,
// M. Carrasco Kind, R. J. Brunner, "Extended Isolation Forest", IEEE TKDE 2021, on F. T. Liu, K. M. Ting, Z.-H. Zhou,
// "Isolation Forest", ICDM 2008; the RO-MAP paper cleans the points of an object with it.

struct IsolationForestOptions {
  int trees = 50;
  // Points that grow one tree, drawn without repetition (psi in the papers). Trees are cut off at a depth of
  // ceil(log2(psi)): who is still among others then is not lonely.
  int sample_size = 64;
  // How many axes a cut may lean to besides one: 0 = cuts across one axis as in Liu et al., whose scores have ghosts
  // beside diagonal or several clusters; 2 = cuts of any slope, which have none.
  int extension_level = 2;
  uint64_t seed = 1;
};

// A score above this is an anomaly. Of planted sets (a box's surface, and outliers off it by more than half its width)
// less than 3 % of the surface and more than 70 % of the outliers score higher.
inline constexpr double kAnomalyScore = 0.6;

// c(n), the mean depth at which a search in a binary tree of `n` random keys fails; paths are measured by it.
double MeanPathLength(size_t n);

// The trees, in one array of nodes. Immutable once grown.
class IsolationForest {
 public:
  // A cut or a leaf of a tree. The children of a cut are neighbours: `child` holds the points with
  // normal . p < offset, child + 1 the others. A leaf is its own child and has an endless offset, so that a walk of
  // `depth_limit` steps ends in it whenever it gets there.
  struct Node {
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    float offset = 0;
    uint32_t child = 0;
    float path_length = 0;  // leaves: their depth, and the mean path among the points that they still hold together
  };

  // Grows trees on `points` (finite, any unit). Every tree draws from a random stream of its own, so that equal input
  // gives the same forest whatever the number of threads.
  IsolationForest(std::span<const Eigen::Vector3d> points, const IsolationForestOptions& options);

  // A forest of trees made elsewhere. `roots`: the index of each tree's first node; `depth_limit`: of the deepest leaf;
  // `sample_size`: points that grew each tree.
  IsolationForest(std::vector<Node> nodes, std::vector<uint32_t> roots, int depth_limit, size_t sample_size);

  // Anomaly score of each point: 2^(-mean path / c(sample size)), 0..1. About 0.5 for a point like the others, near 1
  // for one that a cut or two isolate.
  std::vector<double> Scores(std::span<const Eigen::Vector3d> points) const;

 private:
  // Sum over the trees; points of up to a block side by side, since a single walk waits for memory at every step.
  void AddPaths(std::span<const Eigen::Vector3f> points, std::span<float> path_sums) const;

  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();  // nodes are in single precision, relative to it
  std::vector<Node> nodes_;
  std::vector<uint32_t> roots_;
  int depth_limit_ = 0;
  size_t sample_size_ = 0;
};

// Scores of points by the forest grown on themselves; 0.5 for all when there are fewer than four. Equal input gives
// equal output; the order of the points matters to the random draw only.
std::vector<double> IsolationScores(std::span<const Eigen::Vector3d> points, const IsolationForestOptions& options);

}  // namespace romap::objects
