#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "client/files/image_file.h"
#include "client/importers/recording_contents.h"
#include "common/status.h"

namespace romap::importers {

// Whether a file begins like a JPEG, PNG, BMP, TIFF, WebP or PNM image.
bool LooksLikeImage(const std::string& path);

// The size of an image file, for JPEG and PNG files from the header. INVALID_ARGUMENT: it cannot be read as an image.
// Otherwise as ReadFile.
absl::StatusOr<cv::Size> ImageSize(const std::string& path);

// Makes `path` the color image of a frame. JPEG and PNG files are sent as they are; other images become PNG when they
// are loaded.
void SetImage(const std::string& path, RecordedFrame* frame);

// Encodes an image with 8 or 16 bits as PNG, with little compression because it is done while mapping.
std::string EncodePng(const cv::Mat& image);

// Decodes a PNG or JPEG image to CV_8UC3. INVALID_ARGUMENT names the file.
absl::StatusOr<cv::Mat> DecodeImage(const files::ImageFile& image, const std::string& path);

}  // namespace romap::importers
