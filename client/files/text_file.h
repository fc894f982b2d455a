#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/status.h"

namespace romap::files {

// Whole file as bytes. NOT_FOUND: no such file; INVALID_ARGUMENT: it is there but cannot be read (e.g. a folder).
absl::StatusOr<std::string> ReadFile(const std::string& path);

// Writes (or replaces) a file so that a reader never sees half of it. INVALID_ARGUMENT when the folder is missing or
// the disk refuses.
absl::Status WriteFile(const std::string& path, std::string_view bytes);

// One line of a table, with the place to name in an error.
struct TableLine {
  int number = 0;  // 1 is the first line of the file
  std::vector<std::string> fields;
};

// Lines of a text table, cut at `#`, split at any of `separators` with blanks trimmed; empty lines are left out. A
// blank among the separators swallows runs of blanks; other separators keep empty fields.
absl::StatusOr<std::vector<TableLine>> ReadTable(const std::string& path, char separator);

// The whole of `text` as a finite number; nullopt otherwise ("nan" and "inf" are not finite).
std::optional<double> ParseNumber(std::string_view text);

// Decimal seconds to nanoseconds without the rounding of a double, so that "1700000000.123456789" keeps all digits.
std::optional<int64_t> ParseSeconds(std::string_view text);

// Nanoseconds as decimal seconds with nine decimals: the inverse of ParseSeconds.
std::string FormatSeconds(int64_t timestamp_ns);

}  // namespace romap::files
