#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <opencv2/core/mat.hpp>
#include <stop_token>
#include <string>
#include <vector>

#include "common/camera_model.h"
#include "common/client_input.h"
#include "common/sample_range.h"

namespace romap::session {

// Decodes the color image of a frame to CV_8UC3, BGR. The size that the library read from the header is checked before
// decoding, so that a small file cannot allocate a huge image. INVALID_ARGUMENT: truncated, damaged, not in the stated
// encoding, not of the camera's size, or more work than an image of this size needs (DecodeJpeg(), DecodePng()); the
// message names the field. CANCELLED: stopped. Orientation tags are ignored. `range` is that of the session.
absl::StatusOr<cv::Mat> DecodeColorImage(const FrameInput& input, const CameraModel& camera, SampleRange* range,
                                         const std::stop_token& stop);

// Decodes instance masks to CV_16UC1 labels; empty for MaskEncoding::kNone. INVALID_ARGUMENT: as above, a PNG with more
// than one channel, or runs that do not add up to the size of the image.
absl::StatusOr<cv::Mat> DecodeLabels(const EncodedMasks& masks, const CameraModel& camera, const std::stop_token& stop);

// Decodes the z depth of a frame to CV_32FC1 in map units, 0 = unknown; empty if the frame has no depth.
// INVALID_ARGUMENT: as above, or an invalid scale.
absl::StatusOr<cv::Mat> DecodeDepth(const FrameInput& input, const CameraModel& camera, const std::stop_token& stop);

}  // namespace romap::session
