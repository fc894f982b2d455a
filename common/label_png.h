#pragma once

#include <absl/status/statusor.h>

#include <opencv2/core/mat.hpp>
#include <string_view>

#include "common/decode_limits.h"

namespace romap {

// Decodes a PNG file whose stored integers are labels to CV_16UC1: gray with 1, 2, 4, 8 or 16 bits, or a palette, whose
// colors are ignored. Unlike cv::imdecode, it neither scales small values nor replaces palette indices by colors.
// Errors as DecodePng().
absl::StatusOr<cv::Mat> DecodeLabelPng(std::string_view bytes, const DecodeLimits& limits = {});

}  // namespace romap
