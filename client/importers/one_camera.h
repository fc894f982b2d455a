#pragma once

#include "client/importers/recording_contents.h"
#include "common/status.h"

namespace romap::importers {

// Frames whose intrinsics differ by at most this are used as they are.
inline constexpr double kMaxIntrinsicsDifference_px = 0.1;

// A session has one camera. Resamples frames whose RecordedFrame::camera differs from that of the recording when they
// are loaded, so that they show what the camera of the recording would. Adds the diagnostic intrinsics_unified.
// INVALID_ARGUMENT names the first frame whose camera has another size or another distortion.
absl::Status UseOneCamera(RecordingContents* contents);

// Resamples an image of the camera `from` for the camera `to` of the same lens: pixels have the same normalized
// coordinates. Pixels outside the image become 0. `interpolation`: of OpenCV.
cv::Mat ResampleFor(const cv::Mat& image, const CameraModel& from, const CameraModel& to, int interpolation);

}  // namespace romap::importers
