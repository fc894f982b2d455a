#include "client/eval/calibration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "common/angles.h"

namespace romap::eval::calibration_test {

using Uncertainties = std::vector<std::optional<PoseUncertainty>>;

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
  const Uncertainties uncertainties(10'000, PoseUncertainty{0.5, kRadPerDeg});
  const auto calibration = MeasureCalibration(NormalErrors(10'000), uncertainties, /*scale=*/2);
  ASSERT_TRUE(calibration.has_value());
  EXPECT_EQ(calibration->poses, 10'000U);
  EXPECT_NEAR(calibration->position_coverage, 0.95, 0.01);
  EXPECT_NEAR(calibration->rotation_coverage, 0.95, 0.01);
  EXPECT_NEAR(calibration->position_bound_ratio, 2.7955 / 1.538, 0.03) << "the median of three normal errors is 1.538";
  EXPECT_NEAR(calibration->rotation_bound_ratio, 2.7955 / 1.538, 0.03);
}

TEST(CalibrationTest, SmallSigmasCoverLess) {
  const Uncertainties uncertainties(10'000, PoseUncertainty{0.5, 0.3 * kRadPerDeg});
  const auto calibration = MeasureCalibration(NormalErrors(10'000), uncertainties, /*scale=*/1);
  EXPECT_LT(calibration->position_coverage, 0.5);
  EXPECT_LT(calibration->rotation_coverage, 0.2);
}

TEST(CalibrationTest, LargeSigmasShowInTheRatio) {
  const Uncertainties uncertainties(1'000, PoseUncertainty{10, 10 * kRadPerDeg});
  const auto calibration = MeasureCalibration(NormalErrors(1'000), uncertainties, /*scale=*/1);
  EXPECT_EQ(calibration->position_coverage, 1);
  EXPECT_GT(calibration->position_bound_ratio, 15);
  EXPECT_GT(calibration->rotation_bound_ratio, 15);
}

TEST(CalibrationTest, PosesWithoutUncertaintyDoNotCount) {
  Uncertainties uncertainties(100, std::nullopt);
  std::vector<PoseError> errors(100, {1000, 1000});
  errors[7] = {1, 1};
  uncertainties[7] = PoseUncertainty{1, 1};
  const auto calibration = MeasureCalibration(errors, uncertainties, 1);
  ASSERT_TRUE(calibration.has_value());
  EXPECT_EQ(calibration->poses, 1U);
  EXPECT_EQ(calibration->position_coverage, 1);
  EXPECT_FALSE(MeasureCalibration(errors, Uncertainties(100, std::nullopt), 1).has_value());
  EXPECT_FALSE(MeasureCalibration({}, {}, 1).has_value());
}

}  // namespace romap::eval::calibration_test
