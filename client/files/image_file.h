#pragma once

#include <string>

#include "common/client_input.h"
#include "common/status.h"

namespace romap::files {

// The bytes of a JPEG or PNG file.
struct ImageFile {
  std::string bytes;
  ImageEncoding encoding = ImageEncoding::kPng;
};

// Reads an image without decoding it. INVALID_ARGUMENT names a file that is empty, truncated, or neither PNG nor JPEG.
// Otherwise as ReadFile.
absl::StatusOr<ImageFile> ReadImageFile(const std::string& path);

// Reads a PNG file, for masks and depth: JPEG would change their values. Errors as ReadImageFile.
absl::StatusOr<std::string> ReadPngFile(const std::string& path);

}  // namespace romap::files
