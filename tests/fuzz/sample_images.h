#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

namespace romap::fuzz {

inline constexpr int kSide_px = 16;

// Images of kSide_px x kSide_px for seeds. `channels`: 1 or 3; `bits`: 8 or 16.
cv::Mat SampleImage(int channels, int bits);
std::string SampleJpeg(bool progressive);
std::string SamplePng(int channels, int bits);
// Label images: gray and palettes of 1 to 8 bits, interlaced or not, and gray of 16 bits.
std::vector<std::string> SampleLabelPngs();

}  // namespace romap::fuzz
