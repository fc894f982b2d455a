#include "client/files/image_file.h"

#include "client/files/text_file.h"
#include "common/image_bytes.h"

namespace romap::files {

absl::StatusOr<ImageFile> ReadImageFile(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(std::string bytes, ReadFile(path));
  if (bytes.empty()) return InvalidArgument("{}: the file is empty", path);
  const bool is_png = bytes.starts_with("\x89PNG\r\n\x1a\n");
  if (!is_png && !bytes.starts_with("\xff\xd8\xff")) return InvalidArgument("{}: neither a PNG nor a JPEG file", path);
  const bool is_complete = is_png ? PngHeader(bytes) && IsCompletePng(bytes) : IsCompleteJpeg(bytes);
  if (!is_complete) {
    return InvalidArgument("{}: {} file is truncated ({} bytes)", path, is_png ? "PNG" : "JPEG", bytes.size());
  }
  return ImageFile{std::move(bytes), is_png ? ImageEncoding::kPng : ImageEncoding::kJpeg};
}

absl::StatusOr<std::string> ReadPngFile(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(ImageFile file, ReadImageFile(path));
  if (file.encoding != ImageEncoding::kPng) return InvalidArgument("{}: expected a PNG file (JPEG is lossy)", path);
  return std::move(file.bytes);
}

}  // namespace romap::files
