#include "common/file_status.h"

#include <fmt/format.h>

namespace romap {
namespace {

absl::StatusCode CodeOf(int error) {
  switch (error) {
    case ENOENT:
    case ENOTDIR:
    case ENAMETOOLONG:
    case ENODEV:
    case ENXIO:
      return absl::StatusCode::kNotFound;
    case EACCES:
    case EPERM:
    case EROFS:
    case EEXIST:
    case EISDIR:
    case ENOTEMPTY:
    case ETXTBSY:
    case ELOOP:
      return absl::StatusCode::kPermissionDenied;
    default:
      return absl::StatusCode::kResourceExhausted;
  }
}

}  // namespace

absl::Status FileError(std::string_view path, std::string_view action, int error) {
  const std::string reason = error == 0 ? "unknown reason" : std::generic_category().message(error);
  return absl::Status(CodeOf(error), fmt::format("{}: cannot {}: {}", path, action, reason));
}

absl::Status FileError(std::string_view path, std::string_view action, const std::error_code& error) {
  // On POSIX systems the values of std::system_category are errno values, as are those of std::generic_category.
  return FileError(path, action, error.value());
}

}  // namespace romap
