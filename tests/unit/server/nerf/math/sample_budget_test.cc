#include "server/nerf/math/sample_budget.h"

#include <gtest/gtest.h>

namespace romap::nerf::sample_budget_test {

TEST(SampleCountTest, FollowsTheFinestStepWithinTheLimits) {
  const SampleBudget budget{.finest_step = 0.1f, .min_samples = 4, .max_samples = 16};
  EXPECT_EQ(SampleCount(budget, 0), 0);
  EXPECT_EQ(SampleCount(budget, 0.05f), 4);
  EXPECT_EQ(SampleCount(budget, 0.75f), 8);
  EXPECT_EQ(SampleCount(budget, 5), 16);
}

TEST(SampleCountTest, UniformSamplingUsesTheLargestNumber) {
  const SampleBudget budget{.finest_step = 0.1f, .min_samples = 4, .max_samples = 16, .skip_empty = false};
  EXPECT_EQ(SampleCount(budget, 0.05f), 16);
  EXPECT_EQ(SampleCount(budget, 0), 0);
}

TEST(RaysThatFitTest, IsEven) {
  EXPECT_EQ(RaysThatFit(128, 16), 8);
  EXPECT_EQ(RaysThatFit(128, 12), 10);
  EXPECT_EQ(RaysThatFit(128, 64), 2);
}

}  // namespace romap::nerf::sample_budget_test
