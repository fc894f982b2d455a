#include "common/printable.h"

#include <fmt/format.h>
#include <utf8.h>

#include <iterator>

namespace romap {
namespace {

bool IsControl(uint32_t code) {
  if (code < 0x20 || (code >= 0x7f && code < 0xa0)) return true;
  const bool ends_line = code == 0x2028 || code == 0x2029;
  const bool changes_direction = code == 0x061c || code == 0x200e || code == 0x200f ||
                                 (code >= 0x202a && code <= 0x202e) || (code >= 0x2066 && code <= 0x2069);
  return ends_line || changes_direction;
}

std::string Escaped(uint32_t code) {
  if (code == '\n') return "\\n";
  if (code == '\r') return "\\r";
  if (code == '\t') return "\\t";
  return code < 0x100 ? fmt::format("\\x{:02x}", code) : fmt::format("\\u{:04x}", code);
}

std::string MakePrintable(std::string_view text, bool keep_newlines) {
  std::string result;
  result.reserve(text.size());
  for (auto at = text.begin(); at != text.end();) {
    const auto start = at;
    uint32_t code = 0;
    try {
      code = utf8::next(at, text.end());
    } catch (const utf8::exception&) {
      at = std::next(start);
      result += Escaped(static_cast<uint8_t>(*start));
      continue;
    }
    if (IsControl(code) && !(keep_newlines && code == '\n')) {
      result += Escaped(code);
    } else {
      result.append(start, at);
    }
  }
  return result;
}

}  // namespace

std::string Printable(std::string_view text) { return MakePrintable(text, /*keep_newlines=*/false); }
std::string PrintableLines(std::string_view text) { return MakePrintable(text, /*keep_newlines=*/true); }

}  // namespace romap
