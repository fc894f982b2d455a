#include "server/session/stage_watch.h"

#include <gmock/gmock.h>

#include <chrono>
#include <future>
#include <thread>

#include "tests/support/streams.h"

namespace romap::session::stage_watch_test {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing_support::Eventually;

// A thread that is in a stage until it is released.
class StuckThread {
 public:
  StuckThread(StageWatch* watch, const char* stage) {
    thread_ = std::thread([this, watch, stage] {
      const StageWatch::Scope scope(watch, stage);
      entered_.set_value();
      released_.get_future().wait();
    });
    entered_.get_future().wait();
  }
  ~StuckThread() {
    released_.set_value();
    thread_.join();
  }

 private:
  std::promise<void> entered_, released_;
  std::thread thread_;
};

TEST(StageWatchTest, AStageWithinItsLimitIsNoHang) {
  StageWatch watch;
  EXPECT_FALSE(watch.FindHang(seconds(0)));
  const StuckThread thread(&watch, "mapping");
  EXPECT_FALSE(watch.FindHang(seconds(1000)));
}

TEST(StageWatchTest, AHangIsReportedWithItsStackUntilItEnds) {
  StageWatch watch;
  {
    const StuckThread thread(&watch, "mapping");
    std::optional<StageHang> hang;
    EXPECT_TRUE(Eventually([&] { return (hang = watch.FindHang(milliseconds(20))).has_value(); }));
    EXPECT_EQ(hang->stage, "mapping");
    EXPECT_GT(hang->since_s, 0.02);
    // ThreadSanitizer delivers no signal to a thread that waits.
    if (!testing_support::kUnderSanitizer) {
      EXPECT_THAT(hang->stack, ::testing::HasSubstr("server_session_test"));
    }
  }
  EXPECT_FALSE(watch.FindHang(seconds(0)));
}

// As after a suspension: the stage looks overdue once, and then ends.
TEST(StageWatchTest, AStageThatEndsBeforeItIsConfirmedIsNoHang) {
  StageWatch watch;
  {
    const StuckThread thread(&watch, "mapping");
    std::this_thread::sleep_for(milliseconds(2));
    EXPECT_FALSE(watch.FindHang(milliseconds(1), seconds(1000)));
  }
  const StuckThread next(&watch, "mapping");
  EXPECT_FALSE(watch.FindHang(seconds(1000), seconds(0)));
  EXPECT_TRUE(Eventually([&] { return watch.FindHang(milliseconds(1), milliseconds(20)).has_value(); }));
}

TEST(StageWatchTest, AmongSeveralTheOneThatBeganLastIsNamed) {
  StageWatch watch;
  const StuckThread waiting(&watch, "tracking");
  const StuckThread stuck(&watch, "mapping");
  std::optional<StageHang> hang;
  EXPECT_TRUE(Eventually([&] {
    hang = watch.FindHang(milliseconds(20));
    return hang && hang->stage == "mapping";
  }));
}

}  // namespace romap::session::stage_watch_test
