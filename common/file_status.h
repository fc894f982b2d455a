#pragma once

#include <absl/status/status.h>

#include <cerrno>
#include <string>
#include <string_view>
#include <system_error>

namespace romap {

// The status for a file or folder that cannot be read, created or written, with the reason of the operating system:
// "{path}: cannot {action}: {reason}". `error` is an errno value, 0 if the reason is unknown. The code is NOT_FOUND,
// PERMISSION_DENIED (also if the path is a folder where a file is needed) or, for everything else,
// RESOURCE_EXHAUSTED (disk full, too many open files, input/output error, ...).
absl::Status FileError(std::string_view path, std::string_view action, int error = errno);
absl::Status FileError(std::string_view path, std::string_view action, const std::error_code& error);

}  // namespace romap
