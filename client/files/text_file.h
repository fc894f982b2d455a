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

// One line of a text table.
struct TableLine {
  int number = 0;  // in the file, from 1
  std::vector<std::string> fields;
};

// Reads a text table. `#` starts a comment. Lines are split at `separator` and blanks around fields are removed; empty
// lines are skipped. The separator ' ' stands for any run of blanks; any other separator preserves empty fields. Errors
// as ReadFile.
absl::StatusOr<std::vector<TableLine>> ReadTable(const std::string& path, char separator);

// Parses a finite decimal number that spans the whole text; otherwise nullopt, also for "nan" and "inf".
std::optional<double> ParseNumber(std::string_view text);

// Parses decimal seconds to nanoseconds exactly: a double would round "1700000000.123456789".
std::optional<int64_t> ParseSeconds(std::string_view text);

// Formats nanoseconds as decimal seconds with nine decimals. Inverse of ParseSeconds.
std::string FormatSeconds(int64_t timestamp_ns);

}  // namespace romap::files
