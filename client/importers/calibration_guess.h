#pragma once

#include <opencv2/core/types.hpp>
#include <optional>
#include <string>

#include "client/importers/recording_contents.h"
#include "client/importers/sequence_reader.h"

namespace romap::importers {

// Sets the camera of a recording that has no calibration: that of camera.yaml in `folder`, if there is one. Otherwise a
// pinhole whose focal length is ReadOptions::focal_px, or that of the Exif data of `first_image`
// (FocalLengthIn35mmFilm, Exif 2.32: the diagonal of a film frame is 43.27 mm), or that of a field of view of 60
// degrees along the longer side. Adds the diagnostic calibration_guessed. INVALID_ARGUMENT: camera.yaml is malformed,
// or has another size than the images.
absl::Status GuessCalibration(const std::string& folder, const std::string& first_image, cv::Size size_px,
                              const ReadOptions& options, RecordingContents* contents);

// The focal length for film of 35 mm, in mm, of a JPEG file; nullopt: it does not state one.
std::optional<double> FocalLength35mm(const std::string& path);

}  // namespace romap::importers
