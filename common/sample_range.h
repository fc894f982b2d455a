#pragma once

#include <opencv2/core/mat.hpp>

namespace romap {

// How many bits of 16-bit images are in use. Cameras with 10, 12 or 14 bits store their values in 16-bit files without
// scaling them, so the high byte alone would be nearly black. Keeps the largest number seen, so that the brightness
// does not flicker from image to image.
class SampleRange {
 public:
  // Converts a 16-bit image (any number of channels) to 8 bits: the most significant 8 of the bits in use.
  cv::Mat To8Bit(const cv::Mat& image);
  int bits() const { return bits_; }  // 8, 10, 12, 14 or 16

 private:
  int bits_ = 8;
};

}  // namespace romap
