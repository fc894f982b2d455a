#pragma once

#include <absl/status/statusor.h>

#include <string>

namespace romap::store {

// $XDG_DATA_HOME/romap, ~/.local/share/romap, or /var/lib/romap without a home folder.
std::string DefaultDataDir();

// The data folder of a server, which one process uses at a time.
class DataFolder {
 public:
  // Creates the folder if needed and locks it. FAILED_PRECONDITION: another process uses it; the message has its id.
  // Errors as FileError() (common/file_status.h) if it cannot be created or written.
  static absl::StatusOr<DataFolder> Claim(const std::string& path);

  ~DataFolder();
  DataFolder(DataFolder&& other) noexcept;
  DataFolder& operator=(DataFolder&&) = delete;

  const std::string& path() const { return path_; }

 private:
  DataFolder(std::string path, int lock_fd) : path_(std::move(path)), lock_fd_(lock_fd) {}

  std::string path_;
  int lock_fd_;  // -1: moved from
};

}  // namespace romap::store
