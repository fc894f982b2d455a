#pragma once

#include <absl/status/statusor.h>

#include <opencv2/core/mat.hpp>
#include <string_view>

#include "common/decode_limits.h"

namespace romap {

enum class PngPixels {
  kStored,  // one channel with the stored integers: CV_8UC1 or CV_16UC1; of a palette, the indices
  kBgr,     // CV_8UC3 or CV_16UC3, BGR, without alpha
};

// Decodes a PNG file with libpng, within limits and without output to stderr. Texts, profiles and other parts that are
// not the image are skipped without decompressing them. INVALID_ARGUMENT: not a PNG file, damaged, truncated, more
// data than the image needs, beyond `limits`, or more than one channel for kStored. CANCELLED: stopped.
absl::StatusOr<cv::Mat> DecodePng(std::string_view bytes, PngPixels pixels, const DecodeLimits& limits);

}  // namespace romap
