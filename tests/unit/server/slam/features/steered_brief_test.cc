#include "server/slam/features/steered_brief.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <tuple>

namespace romap::slam::steered_brief_test {

constexpr int kCenter_px = 60;

cv::Mat SmoothNoise(uint64_t seed) {
  cv::Mat image(2 * kCenter_px + 1, 2 * kCenter_px + 1, CV_8UC1);
  cv::RNG(seed).fill(image, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(image, image, {0, 0}, 3);
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

cv::Mat Rotate(const cv::Mat& image, double angle_rad) {
  cv::Mat rotated;
  // OpenCV's angles are counterclockwise. Angles here are from x to y, which is clockwise.
  const cv::Mat rotation = cv::getRotationMatrix2D({kCenter_px, kCenter_px}, -angle_rad * 180 / std::numbers::pi, 1);
  cv::warpAffine(image, rotated, rotation, image.size(), cv::INTER_CUBIC);
  return rotated;
}

TEST(BriefTests, AreDistinctAndWithinThePatchAtAnyRotation) {
  std::set<std::tuple<int, int, int, int>> distinct;
  for (const BriefTest& test : BriefTests()) {
    EXPECT_LE(std::hypot(test.first_x_px, test.first_y_px), kPatchRadius_px);
    EXPECT_LE(std::hypot(test.second_x_px, test.second_y_px), kPatchRadius_px);
    distinct.insert(std::minmax(std::tuple(test.first_x_px, test.first_y_px, test.second_x_px, test.second_y_px),
                                std::tuple(test.second_x_px, test.second_y_px, test.first_x_px, test.first_y_px))
                        .first);
  }
  EXPECT_EQ(distinct.size(), 256U);
}

TEST(IntensityCentroid, PointsToTheBrightSide) {
  for (const double angle_rad : {0.0, 0.7, 2.0, -1.2, 3.1}) {
    cv::Mat image(61, 61, CV_8UC1);
    for (int v = 0; v < image.rows; ++v) {
      for (int u = 0; u < image.cols; ++u) {
        image.at<uint8_t>(v, u) =
            cv::saturate_cast<uint8_t>(128 + 3 * ((u - 30) * std::cos(angle_rad) + (v - 30) * std::sin(angle_rad)));
      }
    }
    const PatchDirection direction = IntensityCentroid(image, 30, 30);
    EXPECT_NEAR(direction.cosine, std::cos(angle_rad), 0.01);
    EXPECT_NEAR(direction.sine, std::sin(angle_rad), 0.01);
  }
}

TEST(IntensityCentroid, UniformPatchHasTheDefaultDirection) {
  const PatchDirection direction = IntensityCentroid(cv::Mat(61, 61, CV_8UC1, cv::Scalar(90)), 30, 30);
  EXPECT_EQ(direction.cosine, 1);
  EXPECT_EQ(direction.sine, 0);
}

TEST(SteeredBrief, EqualsTheUnrotatedTestsForAnUprightPatch) {
  const cv::Mat image = SmoothNoise(1);
  const Descriptor descriptor = SteeredBrief(image, kCenter_px, kCenter_px, {1, 0});
  for (size_t i = 0; i < BriefTests().size(); ++i) {
    const BriefTest& test = BriefTests()[i];
    const bool less = image.at<uint8_t>(kCenter_px + test.first_y_px, kCenter_px + test.first_x_px) <
                      image.at<uint8_t>(kCenter_px + test.second_y_px, kCenter_px + test.second_x_px);
    EXPECT_EQ((descriptor[i / 64] >> (i % 64)) & 1, less ? 1U : 0U) << i;
  }
}

TEST(SteeredBrief, IsInvariantToRotationAndDistinguishesImages) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    const cv::Mat image = SmoothNoise(seed);
    const PatchDirection direction = IntensityCentroid(image, kCenter_px, kCenter_px);
    const Descriptor upright = SteeredBrief(image, kCenter_px, kCenter_px, direction);
    for (const double angle_rad : {0.3, 1.1, 2.5, -2.0}) {
      const cv::Mat rotated = Rotate(image, angle_rad);
      const PatchDirection rotated_direction = IntensityCentroid(rotated, kCenter_px, kCenter_px);
      const double rotation_rad =
          std::atan2(rotated_direction.sine, rotated_direction.cosine) - std::atan2(direction.sine, direction.cosine);
      EXPECT_NEAR(std::remainder(rotation_rad - angle_rad, 2 * std::numbers::pi), 0, 0.1);
      EXPECT_LT(HammingDistance(upright, SteeredBrief(rotated, kCenter_px, kCenter_px, rotated_direction)), 40);
    }
    const cv::Mat other = SmoothNoise(seed + 100);
    EXPECT_GT(HammingDistance(upright, SteeredBrief(other, kCenter_px, kCenter_px,
                                                    IntensityCentroid(other, kCenter_px, kCenter_px))),
              70);
  }
}

}  // namespace romap::slam::steered_brief_test
