#pragma once

#include <vector>

#include "common/geometry.h"

namespace romap::slam {

struct PoseGraphNode {
  Sim3<World, Camera> S_world_camera;
  bool fixed = false;
};

// Measured: S_a_b = S_world_a^-1 * S_world_b.
struct PoseGraphEdge {
  int a = 0;
  int b = 0;
  Sim3<Camera, Camera> S_a_b;
  double weight = 1;  // factor of the squared residual
};

struct PoseGraphOptions {
  bool fix_scale = false;  // SE3: scales do not change
  int max_iterations = 30;
};

struct PoseGraphSummary {
  int iterations = 0;
  double initial_cost = 0;
  double final_cost = 0;
  bool usable = false;  // false: nothing changed
};

// Distributes the error of closed loops over a graph of similarities (Strasdat et al., RSS 2010): residual
// log(S_a_b^-1 * S_world_a^-1 * S_world_b) in sim(3), translations divided by the graph's typical edge length so that
// nothing depends on the scale of the map. Ceres, sparse Cholesky, analytic Jacobians. At least one node must be fixed.
PoseGraphSummary OptimizePoseGraph(std::vector<PoseGraphNode>& nodes, const std::vector<PoseGraphEdge>& edges,
                                   const PoseGraphOptions& options);

}  // namespace romap::slam
