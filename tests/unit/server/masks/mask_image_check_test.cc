#include "server/masks/mask_image_check.h"

#include <gmock/gmock.h>

#include <opencv2/imgproc.hpp>
#include <random>

namespace romap::masks::mask_image_check_test {

using ::testing::HasSubstr;

cv::Point CenterAt(int frame, int step_px) { return {60 + step_px * frame % 200, 80}; }

// A bright disk that moves over a noisy background, at 10 Hz. `mask_center`: of its mask, by frame.
template <class MaskCenter>
std::optional<Diagnostic> CheckWith(int step_px, const MaskCenter& mask_center, double noise = 10, int frames = 80,
                                    bool late = false) {
  MaskImageCheck check;
  cv::RNG random(1);
  std::vector<MaskThumbnail> waiting;
  for (int k = 0; k < frames; ++k) {
    cv::Mat image(160, 320, CV_8UC3), labels(160, 320, CV_16UC1, cv::Scalar(0));
    random.fill(image, cv::RNG::NORMAL, 100, noise);
    cv::circle(image, CenterAt(k, step_px), 25, cv::Scalar(200, 200, 200), cv::FILLED);
    cv::circle(labels, mask_center(k), 25, cv::Scalar(3), cv::FILLED);
    const cv::Mat gray = MakeGray(image);
    check.AddImage(static_cast<uint64_t>(k), 100'000'000LL * k, gray);
    waiting.push_back(MakeThumbnail(labels, gray));
    const int ready = k - (late ? 12 : 0);
    if (ready >= 0) check.AddMasks(static_cast<uint64_t>(ready), waiting[static_cast<size_t>(ready)]);
  }
  return check.Check();
}

std::optional<Diagnostic> CheckWithDelay(int delay, int step_px) {
  return CheckWith(step_px, [&](int k) { return CenterAt(std::max(0, k - delay), step_px); });
}

TEST(MaskImageCheckTest, MasksOfTheirFramesAreSound) {
  for (const int step_px : {1, 2, 4}) {
    EXPECT_FALSE(CheckWithDelay(0, step_px).has_value()) << step_px;
    EXPECT_FALSE(CheckWith(
                     step_px, [&](int k) { return CenterAt(k, step_px); }, 10, 300, /*late=*/true)
                     .has_value());
  }
}

TEST(MaskImageCheckTest, StatesTheDelay) {
  const std::optional<Diagnostic> late = CheckWithDelay(5, 2);
  ASSERT_TRUE(late.has_value());
  EXPECT_EQ(late->code, "masks_displaced");
  EXPECT_THAT(late->text, HasSubstr("5 frames before (0.50 s)"));
  EXPECT_THAT(late->advice, HasSubstr("subtract 0.500 s from"));
  const std::optional<Diagnostic> early = CheckWithDelay(-3, 2);
  ASSERT_TRUE(early.has_value());
  EXPECT_THAT(early->text, HasSubstr("3 frames after (0.30 s)"));
  EXPECT_THAT(early->advice, HasSubstr("add 0.300 s to"));
}

TEST(MaskImageCheckTest, NamesMasksOfOtherImages) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> u(40, 280), v(40, 120);
  const std::optional<Diagnostic> other = CheckWith(
      2, [&](int) { return cv::Point(u(random), v(random)); }, 10, 200);
  ASSERT_TRUE(other.has_value());
  EXPECT_EQ(other->code, "masks_contradict_images");
  EXPECT_EQ(other->severity, Severity::kWarning);
}

TEST(MaskImageCheckTest, AStandingSceneGivesNoDecision) {
  EXPECT_FALSE(CheckWithDelay(5, 0).has_value());
  EXPECT_FALSE(CheckWith(
                   0, [](int) { return cv::Point(200, 60); }, 10, 200)
                   .has_value());
}

// A detector that misses the border by some pixels.
TEST(MaskImageCheckTest, ImpreciseMasksAreSound) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> error(-4, 4);
  const auto center = [&](int k) { return CenterAt(k, 2) + cv::Point(error(random), error(random)); };
  EXPECT_FALSE(CheckWith(2, center, 10, 200).has_value());
}

TEST(MaskImageCheckTest, WithoutMasksOrFramesThereIsNothingToSay) {
  MaskImageCheck check;
  EXPECT_FALSE(check.Check().has_value());
  check.AddImage(0, 0, MakeGray(cv::Mat(20, 20, CV_8UC3, cv::Scalar(0, 0, 0))));
  EXPECT_FALSE(check.Check().has_value());
}

}  // namespace romap::masks::mask_image_check_test
