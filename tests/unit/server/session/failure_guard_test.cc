#include "server/session/failure_guard.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace romap::session::failure_guard_test {

int Throw() { throw std::runtime_error("bad image"); }

TEST(FailureGuardTest, ReturnsTheResult) {
  FailureGuard guard(2);
  const auto result = guard.Run([] { return 3; });
  ASSERT_TRUE(result.ok());
  EXPECT_EQ(*result, 3);
}

TEST(FailureGuardTest, AnExceptionIsTheErrorOfOneFrame) {
  FailureGuard guard(2);
  const auto result = guard.Run(Throw);
  EXPECT_EQ(result.status().code(), absl::StatusCode::kInternal);
  EXPECT_EQ(result.status().message(), "bad image");
  EXPECT_TRUE(guard.Run([] { return 3; }).ok());
}

TEST(FailureGuardTest, TooManyFailuresInARowAreThrown) {
  FailureGuard guard(2);
  for (int i = 0; i < 2; ++i) EXPECT_FALSE(guard.Run(Throw).ok());
  EXPECT_THROW(static_cast<void>(guard.Run(Throw)), std::runtime_error);
}

TEST(FailureGuardTest, ASuccessResetsTheCount) {
  FailureGuard guard(2);
  for (int i = 0; i < 10; ++i) {
    EXPECT_FALSE(guard.Run(Throw).ok());
    EXPECT_TRUE(guard.Run([] { return 3; }).ok());
  }
}

}  // namespace romap::session::failure_guard_test
