#include "common/color_image.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "tests/support/test_png.h"

namespace romap::color_image_test {

std::string Encode(const char* extension, const cv::Mat& image) {
  std::vector<uint8_t> bytes;
  cv::imencode(extension, image, bytes);
  return {bytes.begin(), bytes.end()};
}

cv::Mat Decode(const std::string& bytes) {
  SampleRange range;
  return DecodeColor(bytes, &range).value_or(cv::Mat());
}

TEST(ColorImageTest, IgnoresOrientationTags) {
  cv::Mat image(16, 32, CV_8UC3, cv::Scalar(10, 20, 30));
  image.colRange(0, 16).setTo(cv::Scalar(200, 100, 50));
  for (const char* extension : {".jpg", ".png"}) {
    const std::string plain = Encode(extension, image);
    for (const int orientation : {6, 3}) {
      const std::string tagged = testing_support::WithOrientation(plain, orientation);
      const cv::Mat by_default = cv::imdecode(std::vector<uint8_t>(tagged.begin(), tagged.end()), cv::IMREAD_COLOR);
      const cv::Mat first = by_default(cv::Rect(0, 0, 1, 1));
      EXPECT_TRUE(by_default.rows == 32 || first.at<cv::Vec3b>(0, 0)[0] < 100) << "OpenCV does not see the tag";
      const cv::Mat decoded = Decode(tagged);
      ASSERT_EQ(decoded.size(), image.size()) << extension << " " << orientation;
      EXPECT_EQ(cv::norm(decoded, Decode(plain), cv::NORM_INF), 0);
    }
  }
}

TEST(ColorImageTest, TwelveBitsIn16BitsFillTheRange) {
  cv::Mat image(4, 6, CV_16UC3, cv::Scalar(100, 2000, 4095));
  const cv::Mat color = Decode(Encode(".png", image));
  EXPECT_EQ(color.at<cv::Vec3b>(1, 1), cv::Vec3b(100 >> 4, 2000 >> 4, 255));
  cv::Mat gray(4, 6, CV_16UC1, cv::Scalar(2048));
  EXPECT_EQ(Decode(Encode(".png", gray)).at<cv::Vec3b>(1, 1), cv::Vec3b(128, 128, 128));
}

TEST(ColorImageTest, Full16BitImagesKeepTheHighByte) {
  cv::Mat image(4, 6, CV_16UC3, cv::Scalar(0x1234, 0x80ff, 0xffff));
  EXPECT_EQ(Decode(Encode(".png", image)).at<cv::Vec3b>(2, 3), cv::Vec3b(0x12, 0x80, 0xff));
}

TEST(ColorImageTest, TheRangeOnlyGrows) {
  SampleRange range;
  EXPECT_EQ(range.To8Bit(cv::Mat(2, 2, CV_16UC1, cv::Scalar(4000))).at<uint8_t>(0, 0), 250);
  EXPECT_EQ(range.bits(), 12);
  EXPECT_EQ(range.To8Bit(cv::Mat(2, 2, CV_16UC1, cv::Scalar(160))).at<uint8_t>(0, 0), 10) << "a dark image stays dark";
  EXPECT_EQ(range.bits(), 12);
  range.To8Bit(cv::Mat(2, 2, CV_16UC1, cv::Scalar(4096)));
  EXPECT_EQ(range.bits(), 14);
}

TEST(ColorImageTest, DamagedFilesAreEmpty) {
  EXPECT_TRUE(Decode("").empty());
  EXPECT_TRUE(Decode("not an image").empty());
}

}  // namespace romap::color_image_test
