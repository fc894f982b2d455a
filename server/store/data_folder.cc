#include "server/store/data_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <utility>

#include "common/file_status.h"
#include "common/status.h"

namespace romap::store {
namespace {

namespace fs = std::filesystem;

// The process that has the lock wrote its id into the file.
std::string OwnerOf(int fd) {
  std::array<char, 32> text{};
  const ssize_t bytes = pread(fd, text.data(), text.size() - 1, 0);
  std::string owner(text.data(), bytes > 0 ? static_cast<size_t>(bytes) : 0);
  while (!owner.empty() && owner.back() == '\n') owner.pop_back();
  return owner.empty() ? "another process" : "process " + owner;
}

}  // namespace

std::string DefaultDataDir() {
  if (const char* data = std::getenv("XDG_DATA_HOME"); data != nullptr && *data == '/') return fs::path(data) / "romap";
  if (const char* home = std::getenv("HOME"); home != nullptr && *home == '/')
    return fs::path(home) / ".local/share/romap";
  return "/var/lib/romap";
}

absl::StatusOr<DataFolder> DataFolder::Claim(const std::string& path) {
  std::error_code error;
  if (fs::create_directories(path, error)) fs::permissions(path, fs::perms::owner_all, error);  // others see no images
  if (!error) fs::create_directories(fs::path(path) / "sessions", error);
  if (error) return FileError(path, "create the data folder", error);
  const std::string lock_path = fs::path(path) / "lock";
  const int fd = open(lock_path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (fd < 0) return FileError(lock_path, "open the lock of the data folder");
  // The kernel releases the lock when the process ends in any way, so that no lock is left behind.
  if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
    const std::string owner = OwnerOf(fd);
    close(fd);
    return FailedPrecondition("{}: the data folder is used by {}; stop it, or choose another folder with --data-dir",
                              path, owner);
  }
  DataFolder folder(path, fd);
  const std::string pid = std::to_string(getpid()) + "\n";
  if (ftruncate(fd, 0) != 0 || pwrite(fd, pid.data(), pid.size(), 0) != static_cast<ssize_t>(pid.size())) {
    return FileError(lock_path, "write to the data folder");
  }
  return folder;
}

DataFolder::DataFolder(DataFolder&& other) noexcept
    : path_(std::move(other.path_)), lock_fd_(std::exchange(other.lock_fd_, -1)) {}

DataFolder::~DataFolder() {
  if (lock_fd_ >= 0) close(lock_fd_);
}

}  // namespace romap::store
