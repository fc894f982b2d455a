#pragma once

#include <cstddef>
#include <opencv2/core/mat.hpp>

#include "client/files/sequence.h"
#include "common/status.h"

namespace romap::cli {

// A frame as the map refers to it: without lens distortion.
struct FrameImage {
  cv::Mat color_bgr = {};  // CV_8UC3
  cv::Mat labels = {};     // CV_16UC1, 0 = no instance; empty without a mask
};

// Loads a frame of a sequence. Its mask is absent if it cannot be read. Errors as Sequence::LoadReadable, and
// INVALID_ARGUMENT if the image is damaged.
absl::StatusOr<FrameImage> LoadFrameImage(const files::Sequence& sequence, size_t index);

}  // namespace romap::cli
