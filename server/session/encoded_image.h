#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "common/camera_model.h"
#include "common/client_input.h"

namespace romap::session {

// Decodes a frame's colour image to CV_8UC3, BGR. The size is read from the header before anything is decoded, so a
// small file cannot claim a huge image. INVALID_ARGUMENT: truncated, not of the stated encoding, not the camera's size.
absl::StatusOr<cv::Mat> DecodeColorImage(const FrameInput& input, const CameraModel& camera);

// Decodes instance masks to CV_16UC1 labels; empty Mat when there are none (kNone). INVALID_ARGUMENT: as above,
// or runs that do not add up to the image.
absl::StatusOr<cv::Mat> DecodeLabels(const EncodedMasks& masks, const CameraModel& camera);

// Decodes a frame's depth to CV_32FC1 in map units, 0 = unknown; empty Mat when the frame has none.
absl::StatusOr<cv::Mat> DecodeDepth(const FrameInput& input, const CameraModel& camera);

}  // namespace romap::session
