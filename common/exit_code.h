#pragma once

#include <absl/status/status.h>

namespace romap {

// The exit status of `romap` and `romap-server`. 130 is the shell's convention for SIGINT.
enum ExitCode : int {
  kSuccess = 0,
  kFailure = 1,
  kUsageError = 2,
  kNotAccessible = 3,
  kServerUnavailable = 4,
  kInterrupted = 130,
};

// The table of exit codes for `romap --help`.
inline constexpr const char* kExitCodeHelp =
    "Exit codes:\n"
    "  0    success\n"
    "  1    internal error or other failure\n"
    "  2    invalid command line, configuration or input data\n"
    "  3    a file, folder or session does not exist or cannot be read or written, or a resource is exhausted\n"
    "  4    the server cannot be reached or does not respond\n"
    "  130  interrupted";

ExitCode ToExitCode(const absl::Status& status);

}  // namespace romap
