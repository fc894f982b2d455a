#include "common/exit_code.h"

#include <gtest/gtest.h>

namespace romap::exit_code_test {

TEST(ExitCodeTest, MatchesTheDocumentedTable) {
  EXPECT_EQ(ToExitCode(absl::OkStatus()), 0);
  EXPECT_EQ(ToExitCode(absl::InternalError("")), 1);
  EXPECT_EQ(ToExitCode(absl::FailedPreconditionError("")), 1);
  EXPECT_EQ(ToExitCode(absl::InvalidArgumentError("")), 2);
  EXPECT_EQ(ToExitCode(absl::NotFoundError("")), 3);
  EXPECT_EQ(ToExitCode(absl::PermissionDeniedError("")), 3);
  EXPECT_EQ(ToExitCode(absl::ResourceExhaustedError("")), 3);
  EXPECT_EQ(ToExitCode(absl::UnavailableError("")), 4);
  EXPECT_EQ(ToExitCode(absl::DeadlineExceededError("")), 4);
  EXPECT_EQ(ToExitCode(absl::CancelledError("")), 130);
}

}  // namespace romap::exit_code_test
