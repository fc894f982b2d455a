#include "server/nerf/math/random.h"

#include <gtest/gtest.h>

namespace romap::nerf::random_test {

TEST(RandomTest, IsUniformAndDependsOnEveryCounter) {
  double sum = 0;
  for (uint64_t i = 0; i < 4096; ++i) sum += RandomUniform(1, 2, i);
  EXPECT_NEAR(sum / 4096, 0.5, 0.02);
  EXPECT_NE(RandomBits(1, 2, 3), RandomBits(2, 2, 3));
  EXPECT_NE(RandomBits(1, 2, 3), RandomBits(1, 3, 3));
  EXPECT_NE(RandomBits(1, 2, 3), RandomBits(1, 2, 4));
}

}  // namespace romap::nerf::random_test
