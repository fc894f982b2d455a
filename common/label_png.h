#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string_view>

namespace romap {

inline constexpr int64_t kMaxLabelPixels = 1 << 27;

// Decodes a PNG file whose stored integers are labels to CV_16UC1: gray with 1, 2, 4, 8 or 16 bits, or a palette, whose
// colors are ignored. Unlike cv::imdecode, it neither scales small values nor replaces palette indices by colors.
// INVALID_ARGUMENT: not a PNG file, truncated, damaged, more than one channel, or more than `max_pixels` pixels, which
// is checked before memory is allocated.
absl::StatusOr<cv::Mat> DecodeLabelPng(std::string_view bytes, int64_t max_pixels = kMaxLabelPixels);

}  // namespace romap
