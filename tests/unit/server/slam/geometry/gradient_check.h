#pragma once

#include <gtest/gtest.h>

#include <cmath>

#include "server/slam/geometry/levenberg_marquardt.h"

namespace romap::slam {

// Checks the gradient of normal equations (half the cost's derivative) against central differences of the cost along
// the parameters of `move`. `linearize` and `move` are as for Minimize.
template <int N, class State, class Linearize, class Move>
void ExpectGradientOfCost(const Linearize& linearize, const Move& move, const State& state) {
  constexpr double kStep = 1e-6;
  const NormalEquations<N> equations = linearize(state);
  for (int k = 0; k < N; ++k) {
    const typename NormalEquations<N>::Vector step = kStep * NormalEquations<N>::Vector::Unit(k);
    const double difference = linearize(move(state, step)).cost - linearize(move(state, -step)).cost;
    const double expected = difference / (2 * kStep) / 2;
    EXPECT_NEAR(equations.gradient[k], expected, 1e-4 * std::abs(expected) + 1e-4) << "parameter " << k;
  }
}

}  // namespace romap::slam
