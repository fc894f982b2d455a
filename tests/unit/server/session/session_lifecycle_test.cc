#include "server/session/session_lifecycle.h"

#include <gmock/gmock.h>

namespace romap::session::session_lifecycle_test {

using ::testing::HasSubstr;

std::string Error(const SessionLifecycle& lifecycle) { return std::string(lifecycle.CheckOpen().message()); }

TEST(SessionLifecycleTest, OpenUntilItIsFinished) {
  SessionLifecycle lifecycle("a");
  EXPECT_TRUE(lifecycle.CheckOpen().ok());
  lifecycle.BeginFinish();
  EXPECT_EQ(lifecycle.state(), SessionState::kFinishing);
  EXPECT_EQ(lifecycle.CheckOpen().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(Error(lifecycle), HasSubstr("was finished"));
  lifecycle.Finish();
  EXPECT_EQ(lifecycle.state(), SessionState::kFinished);
}

TEST(SessionLifecycleTest, AFailedSessionSaysWhy) {
  SessionLifecycle lifecycle("a");
  lifecycle.Fail("mapping failed: out of memory");
  lifecycle.Fail("tracking failed: later");
  EXPECT_EQ(lifecycle.state(), SessionState::kFailed);
  EXPECT_EQ(lifecycle.CheckOpen().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(Error(lifecycle), HasSubstr("because mapping failed: out of memory"));
  lifecycle.BeginFinish();
  EXPECT_EQ(lifecycle.state(), SessionState::kFailed) << "a failed session cannot be finished";
}

}  // namespace romap::session::session_lifecycle_test
