#include "server/access/rate_limit.h"

#include <gtest/gtest.h>

namespace romap::access::rate_limit_test {

using std::chrono::milliseconds;
using std::chrono::seconds;

double Seconds(std::chrono::nanoseconds time) { return std::chrono::duration<double>(time).count(); }

TEST(RateLimitTest, ABurstOfOneSecondPassesAndTheRestWaits) {
  RateLimit limit(10);
  const auto start = RateLimit::Clock::now() + seconds(1);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(limit.Take(1, start).count(), 0);
  EXPECT_NEAR(Seconds(limit.Take(1, start)), 0.1, 1e-6);
  EXPECT_NEAR(Seconds(limit.Take(1, start)), 0.2, 1e-6);
  EXPECT_EQ(limit.Take(1, start + milliseconds(300)).count(), 0);
}

TEST(RateLimitTest, APauseIsNotSavedUpBeyondOneSecond) {
  RateLimit limit(10);
  const auto later = RateLimit::Clock::now() + seconds(100);
  EXPECT_EQ(limit.Take(10, later).count(), 0);
  EXPECT_GT(limit.Take(1, later).count(), 0);
}

TEST(RateLimitTest, AnAmountLargerThanTheBucketPassesAfterItsTime) {
  RateLimit limit(10);
  const auto start = RateLimit::Clock::now() + seconds(1);
  EXPECT_NEAR(Seconds(limit.Take(50, start)), 4, 1e-6);
  EXPECT_NEAR(Seconds(limit.Take(1, start + seconds(4))), 0.1, 1e-6);
}

TEST(RateLimitTest, ZeroIsNoLimit) {
  RateLimit limit(0);
  EXPECT_EQ(limit.Take(1e12, RateLimit::Clock::now()).count(), 0);
}

TEST(RateLimitTest, AClockThatSeemsToGoBackGivesNothing) {
  RateLimit limit(10);
  const auto start = RateLimit::Clock::now() + seconds(10);
  limit.Take(10, start);
  EXPECT_NEAR(Seconds(limit.Take(1, start - seconds(5))), 0.1, 1e-6);
}

}  // namespace romap::access::rate_limit_test
