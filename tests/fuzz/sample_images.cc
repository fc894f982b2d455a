#include "tests/fuzz/sample_images.h"

#include <opencv2/imgcodecs.hpp>

#include "tests/support/test_png.h"

namespace romap::fuzz {
namespace {

std::string EncodeAs(const char* extension, const cv::Mat& image, const std::vector<int>& options = {}) {
  std::vector<uint8_t> bytes;
  cv::imencode(extension, image, bytes, options);
  return {bytes.begin(), bytes.end()};
}

}  // namespace

cv::Mat SampleImage(int channels, int bits) {
  cv::Mat image(kSide_px, kSide_px, CV_MAKETYPE(bits == 8 ? CV_8U : CV_16U, channels));
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols * channels; ++x) {
      if (bits == 8) image.ptr<uint8_t>(y)[x] = static_cast<uint8_t>(3 * x + 11 * y);
      if (bits == 16) image.ptr<uint16_t>(y)[x] = static_cast<uint16_t>(300 * x + 1100 * y);
    }
  }
  return image;
}

std::string SampleJpeg(bool progressive) {
  return EncodeAs(".jpg", SampleImage(3, 8), {cv::IMWRITE_JPEG_PROGRESSIVE, progressive ? 1 : 0});
}

std::string SamplePng(int channels, int bits) { return EncodeAs(".png", SampleImage(channels, bits)); }

std::vector<std::string> SampleLabelPngs() {
  using testing_support::PngKind;
  cv::Mat labels = cv::Mat::zeros(kSide_px, kSide_px, CV_8UC1);
  labels(cv::Rect(3, 4, 7, 6)) = 1;
  std::vector<std::string> files;
  for (const int bits : {1, 2, 4, 8}) {
    files.push_back(testing_support::EncodeLabels(labels, PngKind::kGray, bits));
    files.push_back(testing_support::EncodeLabels(labels, PngKind::kPalette, bits, /*interlaced=*/true));
  }
  labels.convertTo(labels, CV_16U, 1000);
  files.push_back(EncodeAs(".png", labels));
  return files;
}

}  // namespace romap::fuzz
