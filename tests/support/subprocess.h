#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace romap::testing_support {

struct ProcessResult {
  int exit_code = -1;  // 128 + signal when it was killed
  std::string out;
  std::string err;
};

// Runs a program to its end.
ProcessResult RunProcess(const std::vector<std::string>& command);

// A program in the background; killed when the object goes.
class BackgroundProcess {
 public:
  explicit BackgroundProcess(const std::vector<std::string>& command);
  ~BackgroundProcess();
  BackgroundProcess(const BackgroundProcess&) = delete;
  BackgroundProcess& operator=(const BackgroundProcess&) = delete;

  // Waits until its output has a line that begins with `prefix` and returns the rest of that line; "" when it ends or
  // half a minute passes before.
  std::string WaitForLine(const std::string& prefix);
  void Signal(int signal) const;
  ProcessResult Wait();

 private:
  pid_t pid_ = -1;
  std::string out_path_, err_path_;
};

// A folder of its own that goes with the object.
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
