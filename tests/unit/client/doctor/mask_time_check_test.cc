#include "client/doctor/mask_time_check.h"

#include <gmock/gmock.h>

#include <opencv2/imgproc.hpp>

namespace romap::doctor::mask_time_check_test {

using ::testing::HasSubstr;

// A bright disk that moves over a noisy background, at 10 Hz. The mask of a frame shows the disk `delay` frames before.
std::optional<Diagnostic> CheckWith(int delay, int step_px, double noise = 10) {
  MaskTimeCheck check;
  cv::RNG random(1);
  for (int k = 0; k < 40; ++k) {
    const auto center = [&](int frame) { return cv::Point(60 + step_px * frame, 80); };
    cv::Mat image(160, 320, CV_8UC3), labels(160, 320, CV_16UC1, cv::Scalar(0));
    random.fill(image, cv::RNG::NORMAL, 100, noise);
    cv::circle(image, center(k), 25, cv::Scalar(200, 200, 200), cv::FILLED);
    cv::circle(labels, center(k - delay), 25, cv::Scalar(3), cv::FILLED);
    check.Add(100'000'000LL * k, image, labels);
  }
  return check.Check();
}

TEST(MaskTimeCheckTest, MasksOfTheirFramesAreSound) {
  EXPECT_FALSE(CheckWith(0, 4).has_value());
  EXPECT_FALSE(CheckWith(0, 1).has_value());
}

TEST(MaskTimeCheckTest, StatesTheDelay) {
  const std::optional<Diagnostic> late = CheckWith(5, 4);
  ASSERT_TRUE(late.has_value());
  EXPECT_EQ(late->code, "masks_displaced");
  EXPECT_THAT(late->text, HasSubstr("5 frames before (0.50 s)"));
  EXPECT_THAT(late->advice, HasSubstr("subtract 0.500 s from"));
  const std::optional<Diagnostic> early = CheckWith(-3, 4);
  ASSERT_TRUE(early.has_value());
  EXPECT_THAT(early->text, HasSubstr("3 frames after (0.30 s)"));
  EXPECT_THAT(early->advice, HasSubstr("add 0.300 s to"));
}

TEST(MaskTimeCheckTest, AStandingSceneGivesNoDecision) { EXPECT_FALSE(CheckWith(5, 0).has_value()); }

TEST(MaskTimeCheckTest, WithoutMasksOrFramesThereIsNothingToSay) {
  MaskTimeCheck check;
  EXPECT_FALSE(check.Check().has_value());
  check.Add(0, cv::Mat(20, 20, CV_8UC3, cv::Scalar(0, 0, 0)), cv::Mat());
  EXPECT_FALSE(check.Check().has_value());
}

}  // namespace romap::doctor::mask_time_check_test
