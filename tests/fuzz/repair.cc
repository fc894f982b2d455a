#include "tests/fuzz/repair.h"

#include <zlib.h>

#include <cstdint>
#include <string_view>

namespace romap::fuzz {
namespace {

uint32_t BigEndian(const std::string& bytes, size_t begin) {
  uint32_t number = 0;
  for (size_t i = 0; i < 4; ++i) number = number << 8 | static_cast<unsigned char>(bytes[begin + i]);
  return number;
}

}  // namespace

void RepairPng(std::string* bytes) {
  constexpr std::string_view kSignature = "\x89PNG\r\n\x1a\n";
  if (!bytes->starts_with(kSignature)) return;
  size_t chunk = kSignature.size();
  while (bytes->size() - chunk >= 12) {  // length, type, checksum
    const size_t length = BigEndian(*bytes, chunk);
    if (length > bytes->size() - chunk - 12) return;
    const auto* type = reinterpret_cast<const Bytef*>(bytes->data() + chunk + 4);
    const auto checksum = static_cast<uint32_t>(crc32(0, type, static_cast<uInt>(length + 4)));
    for (size_t i = 0; i < 4; ++i) (*bytes)[chunk + 8 + length + i] = static_cast<char>(checksum >> (24 - 8 * i));
    chunk += 12 + length;
  }
}

}  // namespace romap::fuzz
