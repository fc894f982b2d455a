#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace romap::slam {

// Huber's robust cost of a squared, normalized error, quadratic up to `bound` and linear in the error beyond; in the
// units of chi2 (no factor 1/2).
inline double HuberCost(double chi2, double bound) {
  return chi2 <= bound ? chi2 : 2 * std::sqrt(bound * chi2) - bound;
}
// Weight of the error in the normal equations: d HuberCost / d chi2.
inline double HuberWeight(double chi2, double bound) { return chi2 <= bound ? 1.0 : std::sqrt(bound / chi2); }

// Normal equations of a problem with N parameters, errors e, Jacobian rows J and weights W: hessian = J^T W J, gradient
// = J^T W e, and the robust cost. The gradient is half the derivative of the cost.
template <int N>
struct NormalEquations {
  using Vector = Eigen::Matrix<double, N, 1>;
  using Matrix = Eigen::Matrix<double, N, N>;

  Matrix hessian = Matrix::Zero();
  Vector gradient = Vector::Zero();
  double cost = 0;

  // Adds one error and its derivative, both divided by the standard deviation.
  void Add(const Vector& derivative, double error, double weight) {
    hessian.noalias() += (weight * derivative) * derivative.transpose();
    gradient.noalias() += (weight * error) * derivative;
  }
};

// Levenberg-Marquardt for few parameters (Marquardt 1963: damping scales the diagonal), without allocation. `linearize`
// computes NormalEquations<N> at a State; `move` applies a step to a State. Sets `state` to the best state found and
// returns the equations at it. Stops when the expected gain of a step is negligible.
template <int N, class State, class Linearize, class Move>
NormalEquations<N> Minimize(int max_iterations, const Linearize& linearize, const Move& move, State& state) {
  constexpr double kNegligibleGain = 1e-6;          // of the cost
  constexpr double kNegligibleAbsoluteGain = 1e-9;  // in units of chi2, for data without noise
  double damping = 1e-4;
  NormalEquations<N> current = linearize(state);
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    typename NormalEquations<N>::Matrix damped = current.hessian;
    damped.diagonal() *= 1 + damping;
    const typename NormalEquations<N>::Vector step = -damped.ldlt().solve(current.gradient);
    const double expected_gain = -step.dot(current.gradient);
    if (!step.allFinite() || !(expected_gain > kNegligibleGain * current.cost + kNegligibleAbsoluteGain)) break;
    const State candidate = move(state, step);
    const NormalEquations<N> next = linearize(candidate);
    if (next.cost < current.cost) {
      state = candidate;
      current = next;
      damping = std::max(damping * 0.1, 1e-9);
    } else {
      damping *= 10;
    }
  }
  return current;
}

}  // namespace romap::slam
