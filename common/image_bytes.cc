#include "common/image_bytes.h"

#include <cstddef>
#include <cstdint>

namespace romap {
namespace {

constexpr std::string_view kPngMagic("\x89PNG\r\n\x1a\n", 8);

uint32_t BigEndian(std::string_view bytes, size_t at, size_t count) {
  uint32_t value = 0;
  for (size_t i = 0; i < count; ++i) value = value << 8 | static_cast<uint8_t>(bytes[at + i]);
  return value;
}

}  // namespace

std::optional<EncodedSize> PngHeader(std::string_view bytes) {
  if (bytes.size() < 33 || !bytes.starts_with(kPngMagic) || bytes.substr(12, 4) != "IHDR") return std::nullopt;
  const auto color_type = static_cast<uint8_t>(bytes[25]);
  const bool is_color = color_type == 2 || color_type == 6;
  const bool has_alpha = color_type == 4 || color_type == 6;
  return EncodedSize{static_cast<int>(BigEndian(bytes, 16, 4)), static_cast<int>(BigEndian(bytes, 20, 4)),
                     static_cast<uint8_t>(bytes[24]), (is_color ? 3 : 1) + (has_alpha ? 1 : 0)};
}

bool IsCompletePng(std::string_view bytes) {
  if (!bytes.starts_with(kPngMagic)) return false;
  constexpr size_t kChunkFrame = 12;  // length, type and checksum
  for (size_t at = kPngMagic.size(); at + kChunkFrame <= bytes.size();) {
    const size_t length = BigEndian(bytes, at, 4);
    if (length > bytes.size() - at - kChunkFrame) return false;
    if (bytes.substr(at + 4, 4) == "IEND") return true;
    at += kChunkFrame + length;
  }
  return false;
}

// A thumbnail in the metadata ends with the same marker, so only a marker after the start of the last scan counts.
bool IsCompleteJpeg(std::string_view bytes) {
  const size_t end = bytes.rfind("\xFF\xD9");
  const size_t scan = bytes.rfind("\xFF\xDA");
  return end != std::string_view::npos && scan != std::string_view::npos && end > scan;
}

}  // namespace romap
