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
// Its weight in the normal equations: d cost / d chi2.
inline double HuberWeight(double chi2, double bound) { return chi2 <= bound ? 1.0 : std::sqrt(bound / chi2); }

// Sums over the errors e of a problem with N parameters and Jacobian rows J: J^T W J, J^T W e, and the robust cost, of
// which the gradient is half the derivative.
template <int N>
struct NormalEquations {
  using Vector = Eigen::Matrix<double, N, 1>;
  using Matrix = Eigen::Matrix<double, N, N>;

  Matrix hessian = Matrix::Zero();
  Vector gradient = Vector::Zero();
  double cost = 0;

  // One error with its derivative, both already divided by the standard deviation.
  void Add(const Vector& derivative, double error, double weight) {
    hessian.noalias() += (weight * derivative) * derivative.transpose();
    gradient.noalias() += (weight * error) * derivative;
  }
};

// Levenberg-Marquardt for few parameters (Marquardt 1963: damping scales the diagonal), without allocation. `linearize`
// makes NormalEquations<N> of a State, `move` a new State of a State and a step. `state` ends at the best found; the
// equations there are returned. A step with a negligible expected gain ends the loop.
template <int N, class State, class Linearize, class Move>
NormalEquations<N> Minimize(int max_iterations, const Linearize& linearize, const Move& move, State& state) {
  constexpr double kNegligibleGain = 1e-6;          // of the cost
  constexpr double kNegligibleAbsoluteGain = 1e-9;  // in units of chi2, for data without noise
  double damping = 1e-4;
  NormalEquations<N> here = linearize(state);
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    typename NormalEquations<N>::Matrix damped = here.hessian;
    damped.diagonal() *= 1 + damping;
    const typename NormalEquations<N>::Vector step = -damped.ldlt().solve(here.gradient);
    const double promised_gain = -step.dot(here.gradient);
    if (!step.allFinite() || !(promised_gain > kNegligibleGain * here.cost + kNegligibleAbsoluteGain)) break;
    const State candidate = move(state, step);
    const NormalEquations<N> there = linearize(candidate);
    if (there.cost < here.cost) {
      state = candidate;
      here = there;
      damping = std::max(damping * 0.1, 1e-9);
    } else {
      damping *= 10;
    }
  }
  return here;
}

}  // namespace romap::slam
