#pragma once

#include <sys/types.h>

#include <chrono>
#include <string>
#include <vector>

#include "tests/support/sanitizer.h"

namespace romap::testing_support {

inline constexpr std::chrono::seconds kProcessTimeout{kUnderSanitizer ? 900 : 240};

struct ProcessResult {
  int exit_code = -1;  // 128 + signal number if a signal ended it
  std::string out;
  std::string err;
};

// Runs a program and waits until it exits. Kills it and adds a test failure after kProcessTimeout.
ProcessResult RunProcess(const std::vector<std::string>& command);

// A program in the background; killed by the destructor.
class BackgroundProcess {
 public:
  explicit BackgroundProcess(const std::vector<std::string>& command);
  ~BackgroundProcess();
  BackgroundProcess(const BackgroundProcess&) = delete;
  BackgroundProcess& operator=(const BackgroundProcess&) = delete;

  // Waits for a line of output that begins with `prefix` and returns the rest of that line. "", with a test failure, if
  // the program ends first or after 30 s.
  std::string WaitForLine(const std::string& prefix);
  void Signal(int signal) const;
  // Waits until the program exits. Kills it and adds a test failure after kProcessTimeout.
  ProcessResult Wait();

 private:
  bool HasEnded() const;

  pid_t pid_ = -1;
  std::string out_path_, err_path_;
};

// A new temporary folder; removed by the destructor.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::string& path() const { return path_; }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

}  // namespace romap::testing_support
