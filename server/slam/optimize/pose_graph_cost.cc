#include "server/slam/optimize/pose_graph_cost.h"

#include <cmath>

namespace romap::slam {

NodeState::NodeState(const Sim3<World, Camera>& start) : start(start) { Refresh(); }

void NodeState::Refresh() {
  const Eigen::Map<const Sim3Vector> v(increment.data());
  S_world_camera = start * ExpSim3<Camera>(v);
  increment_jacobian = RightJacobianOfSim3(v);
}

void RefreshNodes::PrepareForEvaluation(bool /*evaluate_jacobians*/, bool new_evaluation_point) {
  if (!new_evaluation_point) return;
  for (NodeState& node : *nodes_) node.Refresh();
}

RelativePoseCost::RelativePoseCost(const NodeState* a, const NodeState* b, const Sim3<Camera, Camera>& S_a_b,
                                   double weight)
    : a_(a), b_(b), S_b_a_(S_a_b.Inverse()), root_weight_(std::sqrt(weight)) {}

bool RelativePoseCost::Evaluate(double const* const* /*parameters*/, double* residuals, double** jacobians) const {
  const Sim3<Camera, Camera> S_a_b = a_->S_world_camera.Inverse() * b_->S_world_camera;
  const Sim3Vector error = LogSim3(S_b_a_ * S_a_b);
  if (!error.allFinite()) return false;
  Eigen::Map<Sim3Vector> residual(residuals);
  residual = root_weight_ * error;
  if (jacobians == nullptr) return true;

  using Jacobian = Eigen::Map<Eigen::Matrix<double, 7, 7, Eigen::RowMajor>>;
  // Derivative of the logarithm with respect to a right-multiplied increment of its argument. An increment d of b is an
  // increment d of the argument; an increment d of a is an increment -Adjoint(S_a_b^-1) * d of the argument.
  const Sim3Matrix by_argument = root_weight_ * RightJacobianOfSim3(error).inverse();
  if (jacobians[0] != nullptr) {
    Jacobian by_a(jacobians[0]);
    by_a = -by_argument * AdjointOfSim3(S_a_b.Inverse()) * a_->increment_jacobian;
  }
  if (jacobians[1] != nullptr) {
    Jacobian by_b(jacobians[1]);
    by_b = by_argument * b_->increment_jacobian;
  }
  return true;
}

}  // namespace romap::slam
