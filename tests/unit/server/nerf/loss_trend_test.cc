#include "server/nerf/gain_meter.h"

#include <gtest/gtest.h>

#include <cmath>

namespace romap::nerf {
namespace {

TEST(GainMeterTest, MeasuresHowFastALossFalls) {
  GainMeter gain;
  for (uint64_t step = 0; step <= 500; step += 25) gain.Record(step, 3 * std::pow(0.9, step / 100.0));
  ASSERT_TRUE(gain.FallPer100Steps());
  EXPECT_NEAR(*gain.FallPer100Steps(), 0.1, 1e-9);
}

TEST(GainMeterTest, OnlyTheLastLooksCount) {
  GainMeter gain;
  for (uint64_t step = 0; step < 300; step += 25) gain.Record(step, 1 - 0.003 * static_cast<double>(step));
  for (uint64_t step = 300; step < 400; step += 25) gain.Record(step, 0.1);
  EXPECT_NEAR(*gain.FallPer100Steps(), 0, 1e-12);
  for (uint64_t step = 400; step < 500; step += 25) gain.Record(step, 0.1 + 0.001 * static_cast<double>(step - 400));
  EXPECT_LT(*gain.FallPer100Steps(), -0.5) << "it grows";
}

TEST(GainMeterTest, IsNotFooledByNoise) {
  GainMeter flat, falling;
  for (uint64_t i = 0; i < 4; ++i) {
    const double noise = 1 + 0.005 * ((i * 7 % 3) - 1.0);
    flat.Record(25 * i, noise);
    falling.Record(25 * i, noise * std::exp(-0.1 * static_cast<double>(i)));
  }
  EXPECT_LT(std::abs(*flat.FallPer100Steps()), 0.03);
  EXPECT_GT(*falling.FallPer100Steps(), 0.3);
}

TEST(GainMeterTest, KnowsNothingFromFewLooksNorAfterARestart) {
  GainMeter gain;
  EXPECT_FALSE(gain.FallPer100Steps());
  gain.Record(0, 1);
  gain.Record(25, 0.9);
  gain.Record(50, NAN);
  gain.Record(50, 0);
  EXPECT_FALSE(gain.FallPer100Steps());
  gain.Record(50, 0.8);
  EXPECT_TRUE(gain.FallPer100Steps());
  gain.Restart();
  EXPECT_FALSE(gain.FallPer100Steps());
}

}  // namespace
}  // namespace romap::nerf
