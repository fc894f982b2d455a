#pragma once

#include <ceres/evaluation_callback.h>
#include <ceres/sized_cost_function.h>

#include <array>
#include <vector>

#include "server/slam/optimize/lie.h"

namespace romap::slam {

// A node in the optimization: a start and an increment, S = S_start * Exp(increment). Values that edges share are
// computed once per evaluation (Refresh).
struct NodeState {
  // `start`: lengths in the unit of the optimization.
  explicit NodeState(const Sim3<World, Camera>& start);

  // Recomputes S_world_camera and the Jacobian from the increment.
  void Refresh();

  std::array<double, 7> increment{};  // of sim(3)
  Sim3<World, Camera> start;
  Sim3<World, Camera> S_world_camera;  // at the increment
  Sim3Matrix increment_jacobian;       // from the increment to a right-multiplied increment at S_world_camera
};

// Refreshes all nodes before Ceres evaluates.
class RefreshNodes : public ceres::EvaluationCallback {
 public:
  explicit RefreshNodes(std::vector<NodeState>* nodes) : nodes_(nodes) {}

  void PrepareForEvaluation(bool evaluate_jacobians, bool new_evaluation_point) override;

 private:
  std::vector<NodeState>* nodes_;
};

// Residual sqrt(weight) * log(S_a_b^-1 * S_world_a^-1 * S_world_b) with analytic Jacobians with respect to the
// increments of a and b. Reads the states, which must have been refreshed and must outlive the cost.
class RelativePoseCost final : public ceres::SizedCostFunction<7, 7, 7> {
 public:
  RelativePoseCost(const NodeState* a, const NodeState* b, const Sim3<Camera, Camera>& S_a_b, double weight);

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  const NodeState* a_;
  const NodeState* b_;
  Sim3<Camera, Camera> S_b_a_;  // measured
  double root_weight_;
};

}  // namespace romap::slam
