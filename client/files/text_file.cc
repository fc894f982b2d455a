#include "client/files/text_file.h"

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

std::vector<std::string> Split(std::string_view text, char separator) {
  std::vector<std::string> fields;
  while (!text.empty()) {
    const size_t end = separator == ' ' ? text.find_first_of(kBlanks) : text.find(separator);
    fields.emplace_back(Trim(text.substr(0, end)));
    if (end == std::string_view::npos) return fields;
    text.remove_prefix(end + 1);
    if (separator == ' ') text = Trim(text);
    if (text.empty() && separator != ' ') fields.emplace_back();
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
  if (!out) return FileError(path, "write");
  std::error_code error;
  std::filesystem::rename(partial, path, error);
  if (error) return FileError(path, "write", error);
  return absl::OkStatus();
}

absl::Status MakeFolder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) return FileError(path, "create", error);
  return absl::OkStatus();
}

absl::StatusOr<std::vector<TableLine>> ReadTable(const std::string& path, char separator) {
  ROMAP_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  std::vector<TableLine> lines;
  size_t begin = 0;
  for (int number = 1; begin < text.size(); ++number) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    std::string_view line = std::string_view(text).substr(begin, end - begin);
    begin = end + 1;
    line = Trim(line.substr(0, line.find('#')));
    if (!line.empty()) lines.push_back({number, Split(line, separator)});
  }
  return lines;
}

std::optional<double> ParseNumber(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<int64_t> ParseSeconds(std::string_view text) {
  const std::optional<double> approximate_s = ParseNumber(text);
  if (!approximate_s || std::abs(*approximate_s) > 9e9) return std::nullopt;
  if (text.find_first_of("eE") != std::string_view::npos) return std::llround(*approximate_s * 1e9);
  const bool negative = text.starts_with('-');
  int64_t value_ns = 0;
  int decimals = -1;  // digits after the decimal point; -1 before it
  bool round_up = false;
  for (const char c : text) {
    if (c == '.') decimals = 0;
    if (c < '0' || c > '9') continue;
    if (decimals == 9) {
      round_up = c >= '5';
      break;
    }
    value_ns = value_ns * 10 + (c - '0');
    if (decimals >= 0) ++decimals;
  }
  for (int k = std::max(decimals, 0); k < 9; ++k) value_ns *= 10;
  value_ns += round_up ? 1 : 0;
  return negative ? -value_ns : value_ns;
}

std::string FormatSeconds(int64_t timestamp_ns) {
  constexpr int64_t kNsPerSecond = 1'000'000'000;
  return fmt::format("{}{}.{:09}", timestamp_ns < 0 ? "-" : "", std::abs(timestamp_ns / kNsPerSecond),
                     std::abs(timestamp_ns % kNsPerSecond));
}

}  // namespace romap::files
