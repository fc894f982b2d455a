#pragma once

#include <string>
#include <vector>

#include "common/status.h"

namespace romap::files {

struct CsvRow {
  int line = 0;  // of its first field in the file, from 1
  std::vector<std::string> fields;
};

// Reads a file of comma-separated values (RFC 4180). If its first row has no comma, semicolons or tabs separate values,
// as spreadsheets of many countries write them. A field in double quotes keeps every character, also separators and
// line breaks; a doubled quote stands for one quote. Blanks around fields without quotes are removed. Lines that start
// with `#` and empty lines are skipped, as is a byte order mark. Rows end with LF or CRLF. INVALID_ARGUMENT names the
// file and the line: a quote without end, or text after a closing quote. Otherwise as ReadFile.
absl::StatusOr<std::vector<CsvRow>> ReadCsv(const std::string& path);

}  // namespace romap::files
