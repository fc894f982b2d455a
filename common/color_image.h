#pragma once

#include <opencv2/core/mat.hpp>
#include <string_view>

#include "common/sample_range.h"

namespace romap {

// Decodes a JPEG or PNG file to CV_8UC3, BGR, with the pixels as stored: orientation tags are ignored, because the
// calibration, masks and depth refer to the stored pixels. `range` converts images of 16 bits. Empty: the file is
// damaged.
cv::Mat DecodeColor(std::string_view bytes, SampleRange* range);

}  // namespace romap
