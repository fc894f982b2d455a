#include "client/synth/frame_plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace romap::synth::frame_plan_test {

TEST(PlanFramesTest, ChangesNothingByDefault) {
  const auto plans = PlanFrames({.frames = 20});
  ASSERT_EQ(plans.size(), 20U);
  for (size_t i = 0; i < plans.size(); ++i) {
    EXPECT_FALSE(plans[i].missing || plans[i].black || plans[i].blurred);
    EXPECT_EQ(plans[i].shown, i);
    EXPECT_EQ(plans[i].gain, 1);
    EXPECT_EQ(plans[i].gamma, 1);
  }
}

TEST(PlanFramesTest, RangesCountFromOne) {
  const auto plans = PlanFrames({.frames = 10, .cuts = {{1, 2}, {9, 10}}, .black = {{4, 4}}, .blurred = {{5, 6}}});
  for (size_t i = 0; i < plans.size(); ++i) {
    const size_t number = i + 1;
    EXPECT_EQ(plans[i].missing, number <= 2 || number >= 9) << number;
    EXPECT_EQ(plans[i].black, number == 4) << number;
    EXPECT_EQ(plans[i].blurred, number == 5 || number == 6) << number;
  }
}

TEST(PlanFramesTest, RepeatsTheGivenShareButNotAcrossRanges) {
  const SynthOptions options{.frames = 1000, .cuts = {{200, 300}}, .black = {{400, 420}}, .duplicate_share = 0.3};
  const auto plans = PlanFrames(options);
  int repeated = 0;
  for (size_t i = 0; i < plans.size(); ++i) {
    if (plans[i].missing) continue;
    ASSERT_LE(plans[i].shown, i);
    if (plans[i].shown == i) continue;
    ++repeated;
    EXPECT_EQ(plans[i].shown, plans[i - 1].shown) << "the previous image";
    EXPECT_FALSE(plans[plans[i].shown].missing);
    EXPECT_EQ(plans[plans[i].shown].black, plans[i].black);
  }
  EXPECT_NEAR(repeated / 899.0, 0.3, 0.05);
}

TEST(PlanFramesTest, ExposureJumpsWithinItsBounds) {
  const auto plans = PlanFrames({.frames = 500, .fps = 25, .exposure_stops = 1});
  std::set<double> gains;
  for (size_t i = 0; i < plans.size(); ++i) {
    gains.insert(plans[i].gain);
    EXPECT_LE(std::abs(std::log2(plans[i].gain)), 1);
    EXPECT_LE(std::abs(std::log2(plans[i].gamma)), 0.31);
  }
  // 20 seconds with a jump every 0.8 to 2.2 s.
  EXPECT_GE(gains.size(), 9U);
  EXPECT_LE(gains.size(), 26U);
}

TEST(PlanFramesTest, GainChangesInStepsWithinItsRange) {
  const auto plans = PlanFrames({.frames = 750, .fps = 25, .gain_steps = {0.3, 1.6}});
  EXPECT_EQ(plans[0].gain, 1);
  std::set<double> gains;
  double lowest = 1, highest = 1;
  for (size_t i = 0; i < plans.size(); ++i) {
    gains.insert(plans[i].gain);
    lowest = std::min(lowest, plans[i].gain);
    highest = std::max(highest, plans[i].gain);
    EXPECT_EQ(plans[i].gamma, 1);
    if (i > 0 && plans[i].gain != plans[i - 1].gain && plans[i - 1].gain != 1) {
      EXPECT_GT(std::abs(std::log(plans[i].gain / plans[i - 1].gain)), 0.24 * std::log(1.6 / 0.3)) << "a clear step";
    }
  }
  EXPECT_GE(lowest, 0.3);
  EXPECT_LE(highest, 1.6);
  EXPECT_LT(lowest, 0.45);
  EXPECT_GT(highest, 1.2);
  // 30 seconds with a step every 0.8 to 2.2 s.
  EXPECT_GE(gains.size(), 13U);
  EXPECT_LE(gains.size(), 39U);
}

}  // namespace romap::synth::frame_plan_test
