#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <fmt/format.h>

#include <utility>

// absl::string_view is not std::string_view in Debian's Abseil, so messages are formatted with fmt to std::string.

namespace romap {

template <class... Args>
absl::Status InvalidArgument(fmt::format_string<Args...> format, Args&&... args) {
  return absl::InvalidArgumentError(fmt::format(format, std::forward<Args>(args)...));
}
template <class... Args>
absl::Status NotFound(fmt::format_string<Args...> format, Args&&... args) {
  return absl::NotFoundError(fmt::format(format, std::forward<Args>(args)...));
}
template <class... Args>
absl::Status FailedPrecondition(fmt::format_string<Args...> format, Args&&... args) {
  return absl::FailedPreconditionError(fmt::format(format, std::forward<Args>(args)...));
}
template <class... Args>
absl::Status Internal(fmt::format_string<Args...> format, Args&&... args) {
  return absl::InternalError(fmt::format(format, std::forward<Args>(args)...));
}

// The message of a status as std::string, because fmt cannot format absl::string_view.
inline std::string Message(const absl::Status& status) { return std::string(status.message()); }

}  // namespace romap

#define ROMAP_CONCAT_INNER(a, b) a##b
#define ROMAP_CONCAT(a, b) ROMAP_CONCAT_INNER(a, b)
#define ROMAP_RETURN_IF_ERROR(expr)                                   \
  do {                                                                \
    if (absl::Status status_ = (expr); !status_.ok()) return status_; \
  } while (0)
#define ROMAP_ASSIGN_OR_RETURN_IMPL(tmp, lhs, expr) \
  auto tmp = (expr);                                \
  if (!tmp.ok()) return tmp.status();               \
  lhs = std::move(tmp).value()
// ROMAP_ASSIGN_OR_RETURN(auto x, F()): declares x with the value of F(), or returns the status of F().
#define ROMAP_ASSIGN_OR_RETURN(lhs, expr) ROMAP_ASSIGN_OR_RETURN_IMPL(ROMAP_CONCAT(romap_tmp_, __LINE__), lhs, expr)
