#include "common/sample_range.h"

#include <algorithm>
#include <cstdint>

namespace romap {

cv::Mat SampleRange::To8Bit(const cv::Mat& image) {
  const int row_length = image.cols * image.channels();
  uint16_t largest = 0;
  for (int y = 0; y < image.rows; ++y) {
    const auto* row = image.ptr<uint16_t>(y);
    largest = std::max(largest, *std::max_element(row, row + row_length));
  }
  while (bits_ < 16 && largest >> bits_ != 0) bits_ += 2;
  const int shift = bits_ - 8;
  cv::Mat result(image.rows, image.cols, CV_8UC(image.channels()));
  for (int y = 0; y < image.rows; ++y) {
    const auto* row = image.ptr<uint16_t>(y);
    auto* out = result.ptr<uint8_t>(y);
    for (int x = 0; x < row_length; ++x) out[x] = static_cast<uint8_t>(row[x] >> shift);
  }
  return result;
}

}  // namespace romap
