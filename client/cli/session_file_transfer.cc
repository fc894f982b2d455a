#include "client/cli/session_file_transfer.h"

#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "common/file_status.h"
#include "common/status.h"

namespace romap::cli {
namespace {

constexpr size_t kPieceBytes = 1 << 20;

}  // namespace

absl::Status SaveSessionFile(MappingService& service, const std::string& session_id, const std::string& path) {
  const std::string partial = path + ".partial";
  errno = 0;
  std::ofstream file(partial, std::ios::binary | std::ios::trunc);
  if (!file) return FileError(partial, "create");
  const auto write = [&](const std::string& piece) {
    file.write(piece.data(), static_cast<std::streamsize>(piece.size()));
    return file ? absl::OkStatus() : FileError(partial, "write");
  };
  absl::Status saved = service.SaveSession(session_id, write);
  if (saved.ok()) {
    file.close();
    if (!file) saved = FileError(partial, "write");
  }
  std::error_code error;
  if (!saved.ok()) {
    std::filesystem::remove(partial, error);
    return saved;
  }
  std::filesystem::rename(partial, path, error);
  return error ? FileError(path, "write", error) : absl::OkStatus();
}

absl::StatusOr<SessionInfo> LoadSessionFile(MappingService& service, const std::string& path) {
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  if (!file || std::filesystem::is_directory(path)) return FileError(path, "read", errno != 0 ? errno : EISDIR);
  return service.LoadSession([&]() -> absl::StatusOr<std::string> {
    std::string piece(kPieceBytes, '\0');
    file.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    if (file.bad()) return FileError(path, "read");
    piece.resize(static_cast<size_t>(file.gcount()));
    return piece;
  });
}

absl::StatusOr<SessionInfo> CopySession(MappingService& service, const std::string& session_id) {
  const std::string path =
      std::filesystem::temp_directory_path() / fmt::format("romap-copy-{}-{}.romap", session_id, getpid());
  ROMAP_RETURN_IF_ERROR(SaveSessionFile(service, session_id, path));
  auto copy = LoadSessionFile(service, path);
  std::error_code error;
  std::filesystem::remove(path, error);
  return copy;
}

}  // namespace romap::cli
