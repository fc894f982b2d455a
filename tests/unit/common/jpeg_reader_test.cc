#include "common/jpeg_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stop_token>

#include "common/status.h"
#include "tests/support/test_jpeg.h"

namespace romap::jpeg_reader_test {

using ::testing::HasSubstr;
using testing_support::WithScans;

cv::Mat Noise(int width, int height, int type) {
  cv::Mat image(height, width, type);
  cv::RNG random(1);
  random.fill(image, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(image, image, {5, 5}, 0);
  return image;
}

std::string Encode(const cv::Mat& image, const std::vector<int>& parameters = {}) {
  std::vector<uint8_t> bytes;
  cv::imencode(".jpg", image, bytes, parameters);
  return {bytes.begin(), bytes.end()};
}

std::string ErrorOf(const std::string& bytes, const DecodeLimits& limits = {}) {
  const auto image = DecodeJpeg(bytes, limits);
  EXPECT_EQ(image.status().code(), absl::StatusCode::kInvalidArgument) << image.status();
  return Message(image.status());
}

TEST(JpegReaderTest, DecodesTheSamePixelsAsOpenCv) {
  for (const int type : {CV_8UC1, CV_8UC3}) {
    for (const int progressive : {0, 1}) {
      for (const int restart : {0, 3}) {
        const std::string bytes = Encode(
            Noise(61, 43, type), {cv::IMWRITE_JPEG_PROGRESSIVE, progressive, cv::IMWRITE_JPEG_RST_INTERVAL, restart});
        const auto image = DecodeJpeg(bytes, {});
        ASSERT_TRUE(image.ok()) << image.status();
        const cv::Mat expected = cv::imdecode(std::vector<uint8_t>(bytes.begin(), bytes.end()), cv::IMREAD_COLOR);
        ASSERT_EQ(image->type(), CV_8UC3);
        EXPECT_EQ(cv::norm(*image, expected, cv::NORM_INF), 0) << type << " " << progressive << " " << restart;
      }
    }
  }
}

TEST(JpegReaderTest, ReadsTheHeaderAsTheDecoderDoes) {
  const std::string bytes = Encode(Noise(61, 43, CV_8UC3));
  // A scan of the markers by their lengths takes the two bytes after TEM, which has no length, for a length, and finds
  // the size in the comment.
  std::string comment("\xff\xc0\x00\x11\x08\x00\x10\x00\x10\x03\x01\x11\x00\x02\x11\x01\x03\x11\x01", 19);
  std::string segment("\xff\xfe\x00", 3);
  segment += static_cast<char>(comment.size() + 2);
  const std::string misleading = bytes.substr(0, 2) + std::string("\xff\x01", 2) + segment + comment + bytes.substr(2);
  for (const std::string& file : {bytes, misleading}) {
    const absl::StatusOr<EncodedSize> size = JpegHeader(file);
    ASSERT_TRUE(size.ok()) << size.status();
    EXPECT_EQ(size->width_px, 61);
    EXPECT_EQ(size->height_px, 43);
    EXPECT_EQ(size->channels, 3);
  }
  EXPECT_EQ(Message(JpegHeader("").status()), "0 bytes are not a JPEG file");
  EXPECT_EQ(Message(JpegHeader("not an image").status()), "12 bytes are not a JPEG file");
  EXPECT_EQ(Message(JpegHeader(bytes.substr(0, 100)).status()), "JPEG file is truncated (100 bytes)");
}

TEST(JpegReaderTest, LimitsTheScans) {
  const std::string bytes = Encode(Noise(64, 48, CV_8UC1), {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  EXPECT_TRUE(DecodeJpeg(WithScans(bytes, 0), {}).ok());
  EXPECT_TRUE(DecodeJpeg(WithScans(bytes, 40), {}).ok());
  EXPECT_EQ(ErrorOf(WithScans(bytes, 1000)), "JPEG file has 51 or more scans; must have at most 50");
}

TEST(JpegReaderTest, LimitsThePixelsBeforeDecoding) {
  const std::string bytes = Encode(Noise(61, 43, CV_8UC3));
  EXPECT_TRUE(DecodeJpeg(bytes, {.max_pixels = 61 * 43}).ok());
  EXPECT_EQ(ErrorOf(bytes, {.max_pixels = 61 * 43 - 1}), "JPEG header states 61x43 px; expected at most 2622 pixels");
}

TEST(JpegReaderTest, EndsWhenStopped) {
  std::stop_source source;
  const std::string bytes = Encode(Noise(64, 48, CV_8UC1), {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  const DecodeLimits limits{.stop = source.get_token()};
  EXPECT_TRUE(DecodeJpeg(bytes, limits).ok());
  source.request_stop();
  EXPECT_EQ(DecodeJpeg(bytes, limits).status().code(), absl::StatusCode::kCancelled);
}

TEST(JpegReaderTest, RejectsEveryTruncationOfTheHeaderAndReportsThatOfTheImage) {
  const std::string bytes = Encode(Noise(32, 24, CV_8UC3));
  for (size_t length = 0; length < bytes.size() - 2; ++length) EXPECT_NE(ErrorOf(bytes.substr(0, length)), "");
  EXPECT_THAT(ErrorOf(bytes.substr(0, bytes.size() / 2)), HasSubstr("truncated"));
  EXPECT_THAT(ErrorOf(bytes.substr(0, bytes.size() - 40)), HasSubstr("JPEG file is truncated"));
}

TEST(JpegReaderTest, DamageNeitherCrashesNorWritesToStandardError) {
  const std::string bytes = Encode(Noise(32, 24, CV_8UC3), {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  testing::internal::CaptureStderr();
  for (size_t at = 0; at < bytes.size(); ++at) {
    for (const int flip : {1, 0x80, 0xff}) {
      std::string damaged = bytes;
      damaged[at] = static_cast<char>(damaged[at] ^ flip);
      const auto image = DecodeJpeg(damaged, {.max_pixels = 4096});
      if (image.ok()) {
        EXPECT_LE(image->total(), 4096U);
      }
    }
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(JpegReaderTest, NamesTheNumberOfChannels) {
  // Four components: CMYK, which no camera sends.
  std::string bytes = Encode(Noise(32, 24, CV_8UC1));
  const size_t frame = bytes.find("\xff\xc0");
  const size_t scan = bytes.find("\xff\xda");
  ASSERT_NE(frame, std::string::npos);
  ASSERT_NE(scan, std::string::npos);
  const std::string four("\xff\xc0\x00\x14\x08\x00\x18\x00\x20\x04\x01\x11\x00\x02\x11\x00\x03\x11\x00\x04\x11\x00",
                         22);
  const std::string before = bytes.substr(0, frame), after = bytes.substr(frame + 13);
  EXPECT_THAT(ErrorOf(before + four + after), HasSubstr("JPEG has 4 color components; expected 1 (gray) or 3 (color)"));
}

}  // namespace romap::jpeg_reader_test
