#pragma once

#include <absl/status/statusor.h>

#include <exception>
#include <utility>

#include "common/status.h"

namespace romap::session {

// Runs a stage on one frame after the other. An exception (of a library, on one image) costs that frame; if the stage
// fails on too many frames in a row, its state is broken and the exception goes on. Not thread-safe.
class FailureGuard {
 public:
  explicit FailureGuard(int max_failures_in_a_row) : max_failures_in_a_row_(max_failures_in_a_row) {}

  // The result of `work`, or INTERNAL with the message of its exception.
  template <typename Work>
  auto Run(Work&& work) -> absl::StatusOr<decltype(work())> {
    try {
      auto result = std::forward<Work>(work)();
      failures_in_a_row_ = 0;
      return result;
    } catch (const std::exception& e) {
      if (++failures_in_a_row_ > max_failures_in_a_row_) throw;
      return Internal("{}", e.what());
    }
  }

 private:
  const int max_failures_in_a_row_;
  int failures_in_a_row_ = 0;
};

}  // namespace romap::session
