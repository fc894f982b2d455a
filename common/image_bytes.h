#pragma once

#include <optional>
#include <string_view>

namespace romap {

// What the header of an encoded image states.
struct EncodedSize {
  int width_px = 0;
  int height_px = 0;
  int bits = 8;      // per channel, or per palette index
  int channels = 0;  // 1 for a palette
};

// The header of a PNG file (PNG specification, section 11.2.2). nullopt: not a PNG file.
std::optional<EncodedSize> PngHeader(std::string_view bytes);

// Whether a PNG file has all its chunks up to the last one, and a JPEG file its end marker. Decoders fill the missing
// part of a truncated file with gray instead of reporting it.
bool IsCompletePng(std::string_view bytes);
bool IsCompleteJpeg(std::string_view bytes);

}  // namespace romap
