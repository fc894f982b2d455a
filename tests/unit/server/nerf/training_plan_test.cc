#include "server/nerf/training_plan.h"

#include <gtest/gtest.h>

#include <optional>

namespace romap::nerf::training_plan_test {

TEST(TrainingPlanTest, RateDecreasesOverThePlanAndALateViewRaisesIt) {
  NerfConfig config;
  const auto full = static_cast<uint64_t>(config.full_budget_steps);
  TrainingPlan plan(config);
  EXPECT_NEAR(plan.LearningRate(0), config.learning_rate, 1e-9);
  EXPECT_NEAR(plan.LearningRate(full), config.final_learning_rate, 1e-9);
  EXPECT_LT(plan.LearningRate(full / 2), plan.LearningRate(full / 3));
  EXPECT_EQ(plan.AllowedSteps(config.min_views - 1, false), 0u);
  EXPECT_EQ(plan.AllowedSteps(1, true), full);
  EXPECT_EQ(plan.AllowedSteps(config.min_views, false), static_cast<uint64_t>(config.first_budget_steps));
  plan.OnNewView(50);
  EXPECT_EQ(plan.AllowedSteps(40, false), full);
  plan.OnNewView(full);
  EXPECT_EQ(plan.AllowedSteps(40, false), full + static_cast<uint64_t>(config.refine_steps_per_view));
  EXPECT_GT(plan.LearningRate(full), config.final_learning_rate);
  for (int i = 0; i < 1000; ++i) plan.OnNewView(full);
  EXPECT_EQ(plan.AllowedSteps(40, false), full + static_cast<uint64_t>(config.max_refine_steps));
}

TEST(TrainingPlanTest, ADecreasingLossExtendsThePlan) {
  NerfConfig config;
  config.min_loss_decrease = 0.1;
  config.max_extra_steps = 120;
  const auto full = static_cast<uint64_t>(config.full_budget_steps);
  TrainingPlan plan(config);
  plan.OnEvaluation(full - 1, 0.5);
  EXPECT_EQ(plan.AllowedSteps(5, true), full) << "the planned steps are not done";
  plan.OnEvaluation(full, std::nullopt);
  plan.OnEvaluation(full, 0.09);
  EXPECT_EQ(plan.AllowedSteps(5, true), full);
  plan.OnEvaluation(full, 0.11);
  EXPECT_EQ(plan.AllowedSteps(5, true), full + 50);
  EXPECT_LT(plan.LearningRate(full), 1.6 * config.final_learning_rate);
  for (int i = 0; i < 10; ++i) plan.OnEvaluation(full + 1000, 0.5);
  EXPECT_EQ(plan.AllowedSteps(5, true), full + 120);
  plan.OnNewView(full + 120);  // resets the number of extra steps
  const uint64_t planned = plan.AllowedSteps(5, true);
  plan.OnEvaluation(planned, 0.5);
  EXPECT_EQ(plan.AllowedSteps(5, true), planned + 50);
}

}  // namespace romap::nerf::training_plan_test
