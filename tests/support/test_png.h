#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

namespace romap::testing_support {

enum class PngKind { kGray, kPalette };

// Encodes a label image (CV_8UC1) as PNG with 1, 2, 4 or 8 bits per pixel. A palette gets colors unrelated to the
// labels. `interlaced`: in seven passes.
std::string EncodeLabels(const cv::Mat& labels, PngKind kind, int bits, bool interlaced = false);

// A chunk of a PNG file with its length and checksum.
std::string PngChunk(const std::string& type, const std::string& data);

// Compresses `data` followed by `zeros` zeros in the format of zlib.
std::string Deflate(const std::string& data, size_t zeros);

// Adds an orientation tag (Exif 2.32, tag 0x112; 1..8) to the bytes of a JPEG or PNG file.
std::string WithOrientation(const std::string& bytes, int orientation);

}  // namespace romap::testing_support
