#include "client/files/text_file.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "common/file_status.h"

namespace romap::files {
namespace {

constexpr std::string_view kBlanks = " \t\r\v\f";

std::string_view Trim(std::string_view text) {
  const size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

std::vector<std::string> SplitAtBlanks(std::string_view text) {
  std::vector<std::string> fields;
  for (text = Trim(text); !text.empty(); text = Trim(text)) {
    const std::string_view field = text.substr(0, text.find_first_of(kBlanks));
    fields.emplace_back(field);
    text.remove_prefix(field.size());
  }
  return fields;
}

}  // namespace

absl::StatusOr<std::string> ReadFile(const std::string& path) {
  // Opening a folder succeeds, and reading from it throws.
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) return FileError(path, "read", EISDIR);
  errno = 0;
  std::ifstream in(path, std::ios::binary);
  std::string bytes;
  if (in) bytes.assign(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  if (!in) return FileError(path, "read");
  return bytes;
}

absl::Status WriteFile(const std::string& path, std::string_view bytes) {
  const std::string partial = path + ".partial";
  errno = 0;
  std::ofstream out(partial, std::ios::binary | std::ios::trunc);
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  out.close();
  std::error_code error, ignored;
  if (!out) {
    const absl::Status status = FileError(path, "write");
    std::filesystem::remove(partial, ignored);  // frees the space on a full disk
    return status;
  }
  std::filesystem::rename(partial, path, error);
  if (!error) return absl::OkStatus();
  std::filesystem::remove(partial, ignored);
  return FileError(path, "write", error);
}

absl::Status MakeFolder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) return FileError(path, "create", error);
  return absl::OkStatus();
}

absl::StatusOr<std::string> ReadTextFile(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(std::string text, ReadFile(path));
  if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);
  return text;
}

absl::StatusOr<std::vector<TextLine>> ReadLines(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::string text, ReadTextFile(path));
  std::vector<TextLine> lines;
  size_t begin = 0;
  for (int number = 1; begin < text.size(); ++number) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line = Trim(std::string_view(text).substr(begin, end - begin));
    begin = end + 1;
    if (!line.empty() && line.front() != '#') lines.push_back({number, std::string(line)});
  }
  return lines;
}

absl::StatusOr<std::vector<TableLine>> ReadTable(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<TextLine> lines, ReadLines(path));
  std::vector<TableLine> table;
  table.reserve(lines.size());
  for (const TextLine& line : lines) {
    table.push_back({line.number, SplitAtBlanks(std::string_view(line.text).substr(0, line.text.find('#')))});
  }
  return table;
}

std::optional<double> ParseNumber(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<int64_t> ParseSeconds(std::string_view text) { return ParseScaled(text, 9); }

std::optional<int64_t> ParseScaled(std::string_view text, int power) {
  const std::optional<double> approximate = ParseNumber(text);
  if (!approximate || std::abs(*approximate) * std::pow(10, power) > 9e18) return std::nullopt;
  int shift = power;  // decimal places by which the digits move to the left
  if (const size_t exponent = text.find_first_of("eE"); exponent != std::string_view::npos) {
    shift += static_cast<int>(std::clamp(*ParseNumber(text.substr(exponent + 1)), -1e4, 1e4));
    text = text.substr(0, exponent);
  }
  // The digits before the decimal point of the result, and the first one after it.
  std::string digits;
  size_t before_point = std::string::npos;
  for (const char c : text) {
    if (c == '.') before_point = digits.size();
    if (c >= '0' && c <= '9') digits += c;
  }
  const int64_t length = static_cast<int64_t>(std::min(before_point, digits.size())) + shift;
  int64_t value = 0;
  for (int64_t k = 0; k < length; ++k) {
    value = value * 10 + (k < static_cast<int64_t>(digits.size()) ? digits[static_cast<size_t>(k)] - '0' : 0);
  }
  const bool round_up =
      length >= 0 && length < static_cast<int64_t>(digits.size()) && digits[static_cast<size_t>(length)] >= '5';
  value += round_up ? 1 : 0;
  return text.starts_with('-') ? -value : value;
}

std::string FormatSeconds(int64_t timestamp_ns) {
  constexpr int64_t kNsPerSecond = 1'000'000'000;
  return fmt::format("{}{}.{:09}", timestamp_ns < 0 ? "-" : "", std::abs(timestamp_ns / kNsPerSecond),
                     std::abs(timestamp_ns % kNsPerSecond));
}

}  // namespace romap::files
