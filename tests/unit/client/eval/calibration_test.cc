#include "client/eval/calibration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace romap::eval::calibration_test {

// Lengths of 3D normal errors with standard deviation 1 per axis.
std::vector<PoseError> NormalErrors(int count) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  const auto length = [&] {
    return std::sqrt(std::pow(normal(random), 2) + std::pow(normal(random), 2) + std::pow(normal(random), 2));
  };
  std::vector<PoseError> errors;
  for (int k = 0; k < count; ++k) {
    const double position_m = length();
    errors.push_back({position_m, length()});
  }
  return errors;
}

TEST(CalibrationTest, CorrectSigmasCover95Percent) {
  const std::vector<PoseSigma> sigmas(10'000, {.position = 0.5, .rotation_deg = 1});
  const auto calibration = MeasureCalibration(NormalErrors(10'000), sigmas, /*scale=*/2);
  ASSERT_TRUE(calibration.has_value());
  EXPECT_NEAR(calibration->position_coverage, 0.95, 0.01);
  EXPECT_NEAR(calibration->rotation_coverage, 0.95, 0.01);
}

TEST(CalibrationTest, SmallSigmasCoverLess) {
  const std::vector<PoseSigma> sigmas(10'000, {.position = 0.5, .rotation_deg = 0.3});
  const auto calibration = MeasureCalibration(NormalErrors(10'000), sigmas, /*scale=*/1);
  EXPECT_LT(calibration->position_coverage, 0.5);
  EXPECT_LT(calibration->rotation_coverage, 0.2);
}

TEST(CalibrationTest, NoPosesHaveNoCoverage) { EXPECT_FALSE(MeasureCalibration({}, {}, 1).has_value()); }

}  // namespace romap::eval::calibration_test
