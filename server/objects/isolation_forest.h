#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace romap {

struct IsolationForestOptions {
  int trees = 50;
  int sample_size = 64;  // points that grow one tree
  uint64_t seed = 1;
};

// Anomaly score of each point in 0..1: about 0.5 for a point in the midst of others, near 1 for a lonely one. The order
// of the points does not matter to their meaning, only to the random draw; equal input gives equal output. Source: S.
// Hariri, M. Carrasco Kind, R. J. Brunner, "Extended Isolation Forest", IEEE TKDE 2019 (cuts by planes of random slope,
// full extension level), which the RO-MAP paper uses to clean the points of an object.
std::vector<double> IsolationScores(std::span<const Eigen::Vector3d> points, const IsolationForestOptions& options);

}  // namespace romap
