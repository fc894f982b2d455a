#include "common/png_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <stop_token>

#include "common/status.h"
#include "tests/support/test_png.h"

namespace romap::png_reader_test {

using testing_support::Deflate;
using testing_support::EncodeLabels;
using testing_support::PngChunk;
using testing_support::PngKind;

constexpr int kOpenCvColor = cv::IMREAD_COLOR | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION;
const std::string kSignature("\x89PNG\r\n\x1a\n", 8);

cv::Mat Noise(int type) {
  cv::Mat image(43, 61, type);
  cv::RNG random(1);
  random.fill(image, cv::RNG::UNIFORM, 0, image.depth() == CV_16U ? 65536 : 256);
  return image;
}

std::string Encode(const cv::Mat& image) {
  std::vector<uint8_t> bytes;
  cv::imencode(".png", image, bytes);
  return {bytes.begin(), bytes.end()};
}

// A black gray image of 4x4 px with more data in its stream and one more chunk before it.
std::string GrayFile(const std::string& before_data, size_t zeros_after_image) {
  const std::string header("\0\0\0\x04\0\0\0\x04\x08\0\0\0\0", 13);
  return kSignature + PngChunk("IHDR", header) + before_data +
         PngChunk("IDAT", Deflate(std::string(20, '\0'), zeros_after_image)) + PngChunk("IEND", "");
}

TEST(PngReaderTest, DecodesTheSameColorsAsOpenCv) {
  std::vector<std::string> files;
  for (const int type : {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1, CV_16UC3, CV_16UC4}) files.push_back(Encode(Noise(type)));
  for (const int bits : {1, 2, 4, 8}) {
    const cv::Mat labels = Noise(CV_8UC1) & ((1 << bits) - 1);
    for (const bool interlaced : {false, true}) {
      files.push_back(EncodeLabels(labels, PngKind::kPalette, bits, interlaced));
      files.push_back(EncodeLabels(labels, PngKind::kGray, bits, interlaced));
    }
  }
  for (size_t i = 0; i < files.size(); ++i) {
    const auto image = DecodePng(files[i], PngPixels::kBgr, {});
    ASSERT_TRUE(image.ok()) << image.status();
    const cv::Mat expected = cv::imdecode(std::vector<uint8_t>(files[i].begin(), files[i].end()), kOpenCvColor);
    ASSERT_EQ(image->type(), expected.type()) << i;
    EXPECT_EQ(cv::norm(*image, expected, cv::NORM_INF), 0) << i;
  }
}

TEST(PngReaderTest, RejectsMoreDataThanTheImageNeeds) {
  EXPECT_TRUE(DecodePng(GrayFile("", 0), PngPixels::kStored, {}).ok());
  const std::string bomb = GrayFile("", size_t{200} << 20);
  EXPECT_LT(bomb.size(), size_t{1} << 20);
  const auto image = DecodePng(bomb, PngPixels::kStored, {});
  EXPECT_EQ(Message(image.status()), "PNG file is damaged: more data than the image needs");
}

TEST(PngReaderTest, DoesNotDecompressTexts) {
  // A text that libpng would decompress and whose damage it would find.
  const std::string text = PngChunk("zTXt", std::string("key\0\0not compressed", 19));
  const auto image = DecodePng(GrayFile(text, 0), PngPixels::kStored, {});
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(image->size(), cv::Size(4, 4));
}

TEST(PngReaderTest, LimitsThePixelsBeforeDecoding) {
  EXPECT_TRUE(DecodePng(GrayFile("", 0), PngPixels::kBgr, {.max_pixels = 16}).ok());
  EXPECT_EQ(Message(DecodePng(GrayFile("", 0), PngPixels::kBgr, {.max_pixels = 15}).status()),
            "PNG header states 4x4 px; expected at most 15 pixels");
}

TEST(PngReaderTest, EndsWhenStopped) {
  std::stop_source source;
  source.request_stop();
  const DecodeLimits limits{.stop = source.get_token()};
  EXPECT_EQ(DecodePng(GrayFile("", 0), PngPixels::kBgr, limits).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace romap::png_reader_test
