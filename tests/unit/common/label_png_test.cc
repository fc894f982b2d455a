#include "common/label_png.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "common/status.h"
#include "tests/support/test_png.h"

namespace romap::label_png_test {

using ::testing::HasSubstr;
using testing_support::EncodeLabels;
using testing_support::PngKind;

std::string Encode(const cv::Mat& image) {
  std::vector<uint8_t> bytes;
  cv::imencode(".png", image, bytes);
  return {bytes.begin(), bytes.end()};
}

// All values of `bits` bits; the width is not a multiple of a byte.
cv::Mat Values(int bits) {
  cv::Mat values(7, 13, CV_8UC1);
  for (int y = 0; y < values.rows; ++y) {
    for (int x = 0; x < values.cols; ++x) values.at<uint8_t>(y, x) = static_cast<uint8_t>((17 * y + x) % (1 << bits));
  }
  return values;
}

cv::Mat As16Bit(const cv::Mat& image) {
  cv::Mat result;
  image.convertTo(result, CV_16U);
  return result;
}

std::string ErrorOf(const std::string& bytes, const DecodeLimits& limits = {}) {
  const auto labels = DecodeLabelPng(bytes, limits);
  EXPECT_EQ(labels.status().code(), absl::StatusCode::kInvalidArgument);
  return Message(labels.status());
}

TEST(LabelPngTest, TheStoredIntegerIsTheLabel) {
  for (const PngKind kind : {PngKind::kGray, PngKind::kPalette}) {
    for (const int bits : {1, 2, 4, 8}) {
      for (const bool interlaced : {false, true}) {
        const cv::Mat values = Values(bits);
        const auto labels = DecodeLabelPng(EncodeLabels(values, kind, bits, interlaced));
        ASSERT_TRUE(labels.ok()) << labels.status() << " with " << bits << " bits";
        ASSERT_EQ(labels->type(), CV_16UC1);
        EXPECT_EQ(cv::norm(*labels, As16Bit(values), cv::NORM_INF), 0) << bits << " bits";
      }
    }
  }
}

TEST(LabelPngTest, Reads16BitLabels) {
  cv::Mat values(3, 4, CV_16UC1, cv::Scalar(300));
  values.at<uint16_t>(1, 2) = 65535;
  const auto labels = DecodeLabelPng(Encode(values));
  ASSERT_TRUE(labels.ok()) << labels.status();
  EXPECT_EQ(cv::norm(*labels, values, cv::NORM_INF), 0);
}

TEST(LabelPngTest, NamesTheNumberOfChannels) {
  EXPECT_THAT(ErrorOf(Encode(cv::Mat(3, 4, CV_8UC3, cv::Scalar(1, 2, 3)))),
              HasSubstr("PNG has 3 channels; expected one channel whose value is the label"));
  EXPECT_THAT(ErrorOf(Encode(cv::Mat(3, 4, CV_8UC4, cv::Scalar(1, 2, 3, 4)))), HasSubstr("PNG has 4 channels"));
}

TEST(LabelPngTest, RejectsEveryTruncation) {
  const std::string bytes = EncodeLabels(Values(4), PngKind::kPalette, 4);
  for (size_t length = 0; length < bytes.size(); ++length) EXPECT_NE(ErrorOf(bytes.substr(0, length)), "") << length;
  EXPECT_THAT(ErrorOf(bytes.substr(0, bytes.size() - 20)), HasSubstr("PNG file is truncated"));
}

TEST(LabelPngTest, RejectsDamage) {
  const std::string bytes = EncodeLabels(Values(8), PngKind::kGray, 8);
  const size_t data = bytes.find("IDAT");
  for (size_t at = data + 4; at < bytes.size() - 16; ++at) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    EXPECT_THAT(ErrorOf(damaged), HasSubstr("PNG file is damaged")) << at;
  }
}

TEST(LabelPngTest, LimitsTheSizeBeforeAllocation) {
  std::string bytes = EncodeLabels(Values(8), PngKind::kGray, 8);
  EXPECT_THAT(ErrorOf(bytes, {.max_pixels = 90}), HasSubstr("13x7 px; expected at most 90 pixels"));
  EXPECT_TRUE(DecodeLabelPng(bytes, {.max_pixels = 91}).ok());
  for (const size_t at : {16, 20}) bytes.replace(at, 4, "\x7f\xff\xff\xff", 4);
  EXPECT_THAT(ErrorOf(bytes), HasSubstr("2147483647x2147483647"));
}

}  // namespace romap::label_png_test
