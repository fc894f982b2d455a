#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>

#include "server/nerf/math/random.h"

namespace romap::testing_support {

// Compares gradient[i] with (f(x + e) - f(x - e)) / 2 e for `checks` of the `count` entries of x.
inline void ExpectGradient(const std::function<double()>& f, float* x, const float* gradient, size_t count,
                           size_t checks, float step, double tolerance) {
  double largest = 0;
  for (size_t i = 0; i < count; ++i) largest = std::max<double>(largest, std::fabs(gradient[i]));
  ASSERT_GT(largest, 0);
  for (size_t check = 0; check < checks; ++check) {
    const size_t i = checks >= count ? check % count : nerf::RandomBits(3, 9, check) % count;
    const float before = x[i];
    x[i] = before + step;
    const double above = f();
    x[i] = before - step;
    const double below = f();
    x[i] = before;
    EXPECT_NEAR(gradient[i], (above - below) / (2.0 * step), tolerance * largest) << "entry " << i;
  }
}

}  // namespace romap::testing_support
