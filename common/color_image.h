#pragma once

#include <absl/status/statusor.h>

#include <opencv2/core/mat.hpp>
#include <string_view>

#include "common/decode_limits.h"
#include "common/sample_range.h"

namespace romap {

// Decodes a JPEG or PNG file to CV_8UC3, BGR, with the pixels as stored: orientation tags are ignored, because the
// calibration, masks and depth refer to the stored pixels. `range` converts images of 16 bits. Errors as DecodeJpeg()
// and DecodePng().
absl::StatusOr<cv::Mat> DecodeColor(std::string_view bytes, SampleRange* range, const DecodeLimits& limits = {});

}  // namespace romap
