#include "server/slam/optimize/pose_graph.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <numeric>

#include "common/statistics.h"
#include "server/slam/optimize/pose_graph_cost.h"

namespace romap::slam {
namespace {

constexpr int kScaleComponent = 6;

bool IsValid(const std::vector<PoseGraphNode>& nodes, const PoseGraphEdge& edge) {
  const auto count = static_cast<int>(nodes.size());
  return edge.a >= 0 && edge.a < count && edge.b >= 0 && edge.b < count && edge.a != edge.b && edge.S_a_b.IsFinite() &&
         edge.weight > 0 && std::isfinite(edge.weight);
}

std::vector<PoseGraphEdge> ValidEdges(const std::vector<PoseGraphNode>& nodes,
                                      const std::vector<PoseGraphEdge>& edges) {
  std::vector<PoseGraphEdge> valid;
  std::copy_if(edges.begin(), edges.end(), std::back_inserter(valid),
               [&](const PoseGraphEdge& edge) { return IsValid(nodes, edge); });
  return valid;
}

// Whether every node is fixed or connected to a fixed one; otherwise part of the graph is undetermined.
bool IsConnectedToFixed(const std::vector<PoseGraphNode>& nodes, const std::vector<PoseGraphEdge>& edges) {
  std::vector<int> parent(nodes.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int node) {
    while (parent[node] != node) node = parent[node] = parent[parent[node]];
    return node;
  };
  for (const PoseGraphEdge& edge : edges) parent[root(edge.a)] = root(edge.b);
  std::vector<uint8_t> anchored(nodes.size(), 0);
  for (size_t i = 0; i < nodes.size(); ++i) {
    if (nodes[i].fixed) anchored[root(static_cast<int>(i))] = 1;
  }
  for (size_t i = 0; i < nodes.size(); ++i) {
    if (!anchored[root(static_cast<int>(i))]) return false;
  }
  return true;
}

// Median length of the edges; 1 if the median is 0.
double TypicalLengthMu(const std::vector<PoseGraphEdge>& edges) {
  std::vector<double> lengths_mu;
  for (const PoseGraphEdge& edge : edges) lengths_mu.push_back(edge.S_a_b.translation().norm());
  const double typical_mu = Median(std::move(lengths_mu));
  return typical_mu > 0 ? typical_mu : 1;
}

template <class To, class From>
Sim3<To, From> ScaleLengths(double factor, const Sim3<To, From>& S) {
  return {S.scale(), S.rotation(), factor * S.translation()};
}

// Solves a pose graph with Ceres.
class PoseGraphSolver {
 public:
  PoseGraphSolver(const std::vector<PoseGraphNode>& nodes, const std::vector<PoseGraphEdge>& edges, bool fix_scale);

  PoseGraphSummary Run(int max_iterations);
  // Returns false and writes nothing if a number is not finite.
  bool WriteBack(std::vector<PoseGraphNode>& nodes) const;

 private:
  static ceres::Problem::Options ProblemOptions(RefreshNodes* refresh);

  double unit_mu_;
  std::vector<NodeState> states_;
  RefreshNodes refresh_{&states_};
  ceres::SubsetManifold fixed_scale_{7, {kScaleComponent}};
  std::deque<RelativePoseCost> costs_;  // in a deque, because costs cannot be moved
  ceres::Problem ceres_;                // last, because it refers to the other members
};

ceres::Problem::Options PoseGraphSolver::ProblemOptions(RefreshNodes* refresh) {
  ceres::Problem::Options options;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.evaluation_callback = refresh;
  return options;
}

PoseGraphSolver::PoseGraphSolver(const std::vector<PoseGraphNode>& nodes, const std::vector<PoseGraphEdge>& edges,
                                 bool fix_scale)
    : unit_mu_(TypicalLengthMu(edges)), ceres_(ProblemOptions(&refresh_)) {
  states_.reserve(nodes.size());
  for (const PoseGraphNode& node : nodes) states_.emplace_back(ScaleLengths(1 / unit_mu_, node.S_world_camera));
  for (const PoseGraphEdge& edge : edges) {
    NodeState& a = states_[edge.a];
    NodeState& b = states_[edge.b];
    costs_.emplace_back(&a, &b, ScaleLengths(1 / unit_mu_, edge.S_a_b), edge.weight);
    ceres_.AddResidualBlock(&costs_.back(), nullptr, a.increment.data(), b.increment.data());
  }
  for (size_t i = 0; i < nodes.size(); ++i) {
    double* increment = states_[i].increment.data();
    if (!ceres_.HasParameterBlock(increment)) continue;
    if (nodes[i].fixed) ceres_.SetParameterBlockConstant(increment);
    if (fix_scale) ceres_.SetManifold(increment, &fixed_scale_);
  }
}

PoseGraphSummary PoseGraphSolver::Run(int max_iterations) {
  ceres::Solver::Options solver;
  solver.max_num_iterations = max_iterations;
  solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary ceres_summary;
  ceres::Solve(solver, &ceres_, &ceres_summary);
  PoseGraphSummary summary;
  summary.iterations = std::max(0, static_cast<int>(ceres_summary.iterations.size()) - 1);
  summary.initial_cost = ceres_summary.initial_cost;
  summary.final_cost = ceres_summary.final_cost;
  summary.usable = ceres_summary.IsSolutionUsable();
  return summary;
}

bool PoseGraphSolver::WriteBack(std::vector<PoseGraphNode>& nodes) const {
  std::vector<Sim3<World, Camera>> optimized;
  for (const NodeState& state : states_) {
    const Eigen::Map<const Sim3Vector> increment(state.increment.data());
    optimized.push_back(ScaleLengths(unit_mu_, state.start * ExpSim3<Camera>(increment)));
    if (!optimized.back().IsFinite()) return false;
  }
  for (size_t i = 0; i < nodes.size(); ++i) {
    if (!nodes[i].fixed) nodes[i].S_world_camera = optimized[i];
  }
  return true;
}

}  // namespace

PoseGraphSummary OptimizePoseGraph(std::vector<PoseGraphNode>& nodes, const std::vector<PoseGraphEdge>& edges,
                                   const PoseGraphOptions& options) {
  const auto is_finite = [](const PoseGraphNode& node) { return node.S_world_camera.IsFinite(); };
  const std::vector<PoseGraphEdge> valid = ValidEdges(nodes, edges);
  if (valid.empty() || !std::all_of(nodes.begin(), nodes.end(), is_finite) || !IsConnectedToFixed(nodes, valid))
    return {};
  PoseGraphSolver solver(nodes, valid, options.fix_scale);
  PoseGraphSummary summary = solver.Run(options.max_iterations);
  summary.usable = summary.usable && solver.WriteBack(nodes);
  return summary;
}

}  // namespace romap::slam
