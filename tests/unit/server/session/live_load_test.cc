#include "server/session/live_load.h"

#include <gtest/gtest.h>

namespace romap::session::live_load_test {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(LiveLoadTest, IsTheMeanOfTheLastSeconds) {
  LiveLoad load;
  const LiveLoad::Clock::time_point start{seconds(1000)};
  EXPECT_FALSE(load.Cores(start).has_value());
  for (int i = 0; i < 25 * 20; ++i) load.Add(0.02, start + milliseconds(40 * i));
  const auto now = start + milliseconds(20 * 1000 - 1);
  EXPECT_NEAR(load.Cores(now).value(), 0.5, 0.03);
  EXPECT_NEAR(load.Cores(now + seconds(5)).value(), 0.25, 0.03);
  EXPECT_EQ(load.Cores(now + seconds(11)).value(), 0);
}

TEST(LiveLoadTest, TheFirstSecondsAreNotJudged) {
  LiveLoad load;
  const LiveLoad::Clock::time_point start{seconds(1000)};
  for (int i = 0; i < 100; ++i) load.Add(0.01, start + milliseconds(40 * i));
  EXPECT_FALSE(load.Cores(start + seconds(2)).has_value());
  EXPECT_NEAR(load.Cores(start + seconds(4)).value(), 0.25, 0.03);
}

}  // namespace romap::session::live_load_test
