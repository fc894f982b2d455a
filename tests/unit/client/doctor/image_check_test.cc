#include "client/doctor/image_check.h"

#include <gmock/gmock.h>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace romap::doctor::image_check_test {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

cv::Mat Texture(int index) {
  cv::Mat image(48, 64, CV_8UC3);
  cv::RNG(static_cast<uint64_t>(index) + 1).fill(image, cv::RNG::UNIFORM, 40, 200);
  return image;
}

cv::Mat Labels() {
  cv::Mat labels = cv::Mat::zeros(48, 64, CV_16UC1);
  labels(cv::Rect(10, 10, 20, 20)).setTo(1);
  return labels;
}

std::vector<std::string> CodesOf(const ImageCheck& check) {
  std::vector<std::string> codes;
  for (const Diagnostic& diagnostic : check.Diagnostics()) codes.push_back(diagnostic.code);
  return codes;
}

class ImageCheckTest : public ::testing::Test {
 protected:
  // Adds 20 frames, every third of them changed.
  template <class Change>
  std::vector<std::string> CodesAfter(const Change& change) {
    for (int i = 0; i < 20; ++i) {
      cv::Mat image = Texture(i);
      if (i % 3 == 0) change(image, i);
      check_.Add(static_cast<uint64_t>(i) + 1, image, Labels());
    }
    return CodesOf(check_);
  }

  ImageCheck check_;
};

TEST_F(ImageCheckTest, SoundImages) {
  EXPECT_THAT(CodesAfter([](cv::Mat&, int) {}), IsEmpty());
}

TEST_F(ImageCheckTest, BlurredImages) {
  EXPECT_THAT(CodesAfter([](cv::Mat& image, int) { cv::blur(image, image, {5, 5}); }), ElementsAre("images_blurred"));
}

TEST_F(ImageCheckTest, OverexposedAndDarkImages) {
  EXPECT_THAT(
      CodesAfter([](cv::Mat& image, int i) { image.rowRange(0, 32).setTo(cv::Scalar::all(i % 2 == 0 ? 255 : 0)); }),
      ElementsAre("images_overexposed", "images_dark"));
}

TEST_F(ImageCheckTest, RepeatedImages) {
  EXPECT_THAT(CodesAfter([](cv::Mat& image, int i) { Texture(i - 1).copyTo(image); }), ElementsAre("images_repeated"));
}

TEST_F(ImageCheckTest, MasksWithoutLabels) {
  for (int i = 0; i < 10; ++i) check_.Add(static_cast<uint64_t>(i) + 1, Texture(i), cv::Mat::zeros(48, 64, CV_16UC1));
  EXPECT_THAT(CodesOf(check_), ElementsAre("masks_empty"));
}

TEST_F(ImageCheckTest, NoMasks) {
  for (int i = 0; i < 10; ++i) check_.Add(static_cast<uint64_t>(i) + 1, Texture(i), cv::Mat());
  EXPECT_THAT(CodesOf(check_), ElementsAre("masks_missing"));
}

}  // namespace romap::doctor::image_check_test
