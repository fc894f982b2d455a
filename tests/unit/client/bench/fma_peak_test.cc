#include "client/bench/fma_peak.h"

#include <gtest/gtest.h>

#include <cmath>

namespace romap::bench::fma_peak_test {

// Checks only a plausible range, i.e. the units.
TEST(FmaPeakTest, IsInAPlausibleRange) {
  const double one = MeasureFmaPeakGflops(1, 0.01);
  EXPECT_TRUE(std::isfinite(one));
  EXPECT_GT(one, 0.01);
  EXPECT_LT(one, 1e4);
  EXPECT_GT(MeasureFmaPeakGflops(2, 0.01), 0.01);
}

}  // namespace romap::bench::fma_peak_test
