#include "server/nerf/loss_trend.h"

#include <gtest/gtest.h>

#include <cmath>

namespace romap::nerf::loss_trend_test {

TEST(LossTrendTest, MeasuresTheRelativeDecrease) {
  LossTrend trend;
  for (uint64_t step = 0; step <= 500; step += 25) trend.Record(step, 3 * std::pow(0.9, step / 100.0));
  ASSERT_TRUE(trend.DecreasePer100Steps());
  EXPECT_NEAR(*trend.DecreasePer100Steps(), 0.1, 1e-9);
}

TEST(LossTrendTest, UsesOnlyTheLastMeasurements) {
  LossTrend trend;
  for (uint64_t step = 0; step < 300; step += 25) trend.Record(step, 1 - 0.003 * static_cast<double>(step));
  for (uint64_t step = 300; step < 400; step += 25) trend.Record(step, 0.1);
  EXPECT_NEAR(*trend.DecreasePer100Steps(), 0, 1e-12);
  for (uint64_t step = 400; step < 500; step += 25) trend.Record(step, 0.1 + 0.001 * static_cast<double>(step - 400));
  EXPECT_LT(*trend.DecreasePer100Steps(), -0.5) << "the loss increases";
}

TEST(LossTrendTest, IsRobustAgainstNoise) {
  LossTrend flat, falling;
  for (uint64_t i = 0; i < 4; ++i) {
    const double noise = 1 + 0.005 * ((i * 7 % 3) - 1.0);
    flat.Record(25 * i, noise);
    falling.Record(25 * i, noise * std::exp(-0.1 * static_cast<double>(i)));
  }
  EXPECT_LT(std::abs(*flat.DecreasePer100Steps()), 0.03);
  EXPECT_GT(*falling.DecreasePer100Steps(), 0.3);
}

TEST(LossTrendTest, NeedsThreeValidMeasurementsAfterARestart) {
  LossTrend trend;
  EXPECT_FALSE(trend.DecreasePer100Steps());
  trend.Record(0, 1);
  trend.Record(25, 0.9);
  trend.Record(50, NAN);
  trend.Record(50, 0);
  EXPECT_FALSE(trend.DecreasePer100Steps());
  trend.Record(50, 0.8);
  EXPECT_TRUE(trend.DecreasePer100Steps());
  trend.Restart();
  EXPECT_FALSE(trend.DecreasePer100Steps());
}

}  // namespace romap::nerf::loss_trend_test
