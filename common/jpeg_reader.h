#pragma once

#include <absl/status/statusor.h>

#include <opencv2/core/mat.hpp>
#include <string_view>

#include "common/decode_limits.h"
#include "common/image_bytes.h"

namespace romap {

// A scan of a progressive file may have a few bytes, but takes the time of the whole image. Usual files have about ten.
inline constexpr int kMaxJpegScans = 50;

// The header of a JPEG file as libjpeg reads it. INVALID_ARGUMENT: not a JPEG file, or its header is truncated or
// damaged.
absl::StatusOr<EncodedSize> JpegHeader(std::string_view bytes);

// Decodes a JPEG file to CV_8UC3, BGR, as cv::imdecode does, but within limits and without output to stderr.
// INVALID_ARGUMENT: damaged, truncated, neither gray nor color, or beyond `limits` or kMaxJpegScans. CANCELLED:
// stopped.
absl::StatusOr<cv::Mat> DecodeJpeg(std::string_view bytes, const DecodeLimits& limits);

}  // namespace romap
