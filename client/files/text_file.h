#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/status.h"

namespace romap::files {

// Reads a whole file. Errors: those of FileError (common/file_status.h), with the reason of the operating system.
absl::StatusOr<std::string> ReadFile(const std::string& path);

// Creates or replaces a file atomically: readers see the old or the new contents, never a partial file. Errors as
// ReadFile.
absl::Status WriteFile(const std::string& path, std::string_view bytes);

// Creates a folder and its missing parents. OK if it exists. Errors as ReadFile.
absl::Status MakeFolder(const std::string& path);

// Reads a text file without its byte order mark (UTF-8), if any. Errors as ReadFile.
absl::StatusOr<std::string> ReadTextFile(const std::string& path);

struct TextLine {
  int number = 0;  // in the file, from 1
  std::string text;
};

// Reads the lines of a text file without the blanks around them. Empty lines and lines that start with `#` are skipped.
// Errors as ReadFile.
absl::StatusOr<std::vector<TextLine>> ReadLines(const std::string& path);

// One line of a text table.
struct TableLine {
  int number = 0;  // in the file, from 1
  std::vector<std::string> fields;
};

// Reads a text table whose fields are separated by blanks. `#` starts a comment, also behind the fields of a line.
// Errors as ReadFile.
absl::StatusOr<std::vector<TableLine>> ReadTable(const std::string& path);

// Parses a finite decimal number that spans the whole text; otherwise nullopt, also for "nan" and "inf".
std::optional<double> ParseNumber(std::string_view text);

// Parses decimal seconds to nanoseconds exactly: a double would round "1700000000.123456789".
std::optional<int64_t> ParseSeconds(std::string_view text);

// Parses a decimal number times 10^power to an integer exactly; decimals of the result are rounded. nullopt as
// ParseNumber, or if the result does not fit.
std::optional<int64_t> ParseScaled(std::string_view text, int power);

// Formats nanoseconds as decimal seconds with nine decimals. Inverse of ParseSeconds.
std::string FormatSeconds(int64_t timestamp_ns);

}  // namespace romap::files
