#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client/files/time_unit.h"
#include "common/status.h"

namespace romap::files {

struct ListedFile {
  int64_t timestamp_ns = 0;
  std::string path;
};

// The contents of rgb.txt, mask.txt or depth.txt.
struct FileList {
  std::vector<ListedFile> files;  // timestamps strictly increase
  TimeUnit unit = TimeUnit::kSeconds;
};

// At most this share of the images, masks or depth images of a sequence may be unreadable.
inline constexpr double kMaxUnreadableShare = 0.2;

// Reads lines of `timestamp filename` from `dir`/`name`. The filename is relative to `dir`. It may contain blanks and
// may be in double quotes; `#` after a blank starts a comment. INVALID_ARGUMENT names the file and the line: malformed,
// or timestamps that do not increase. NOT_FOUND: more than kMaxUnreadableShare of the files do not exist. Otherwise as
// ReadFile.
absl::StatusOr<FileList> ReadFileList(const std::string& dir, const std::string& name);

}  // namespace romap::files
