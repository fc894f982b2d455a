#include "server/session/scheduler.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tests/unit/server/session/pipeline_fixture.h"

namespace romap::session::scheduler_test {

// Runs a pipeline without objects, so that there is nothing to train.
class SchedulerTest : public PipelineFixture {
 protected:
  void Start(
      FrameMode mode, bool single_thread, std::function<void()> tick = [] {}) {
    SessionConfig config;
    config.frame_queue = 2;
    config.single_thread = single_thread;
    Scheduler::Callbacks callbacks{
        .tick = std::move(tick),
        .finished = [this] { finished_ = true; },
        .failed = [this](const char* stage,
                         const std::string& what) { failure_.set_value(std::string(stage) + ": " + what); }};
    scheduler_ = std::make_unique<Scheduler>("a", config, mode, &pipeline_, &ledger_, std::move(callbacks));
  }

  void ExpectAllFramesProcessed(bool single_thread) {
    Start(FrameMode::kReplay, single_thread);
    for (uint64_t id = 1; id <= 5; ++id) EXPECT_TRUE(scheduler_->Offer(testing_support::MakeFrame(id)));
    scheduler_->CloseInputs();
    ASSERT_TRUE(testing_support::Eventually([&] { return finished_.load(); }));
    const std::vector<FrameAck> acks = ReadAcks();
    ASSERT_EQ(acks.size(), 5u);
    for (size_t i = 0; i < acks.size(); ++i) {
      EXPECT_EQ(acks[i].frame_id, i + 1);
      EXPECT_TRUE(acks[i].accepted) << acks[i].error;
    }
    EXPECT_EQ(Counters().frames_processed, 5u);
    EXPECT_FALSE(scheduler_->Offer(testing_support::MakeFrame(6))) << "the inputs are closed";
  }

  std::atomic<bool> finished_ = false;
  std::promise<std::string> failure_;
  std::unique_ptr<Scheduler> scheduler_;  // last: its threads use all of the above
};

TEST_F(SchedulerTest, ThreadsProcessAllFramesInOrder) { ExpectAllFramesProcessed(/*single_thread=*/false); }

TEST_F(SchedulerTest, OneThreadProcessesAllFramesInOrder) { ExpectAllFramesProcessed(/*single_thread=*/true); }

TEST_F(SchedulerTest, StopEndsWithoutFinishing) {
  Start(FrameMode::kReplay, /*single_thread=*/false);
  scheduler_->Stop();
  EXPECT_FALSE(finished_);
  EXPECT_FALSE(scheduler_->Offer(testing_support::MakeFrame(1)));
  scheduler_->Stop();  // has no effect
}

// A callback on the mapping thread stands for a stage that does not return.
TEST_F(SchedulerTest, AStageThatHangsIsFoundAndEndsTheProcessing) {
  std::promise<void> mapping_begins, may_map, release;
  bool is_first = true;
  Start(FrameMode::kLive, /*single_thread=*/false, [&] {
    if (!std::exchange(is_first, false)) return;
    mapping_begins.set_value();
    may_map.get_future().wait();
  });
  mapping_begins.get_future().wait();
  EXPECT_TRUE(scheduler_->Offer(testing_support::MakeFrame(1)));
  ledger_.WhenSettled([&] { release.get_future().wait(); });
  may_map.set_value();
  EXPECT_FALSE(scheduler_->FindHang(std::chrono::hours(1)));
  std::optional<StageHang> hang;
  EXPECT_TRUE(testing_support::Eventually(
      [&] { return (hang = scheduler_->FindHang(std::chrono::milliseconds(50))).has_value(); }));
  EXPECT_EQ(hang->stage, "mapping");
  scheduler_->Abandon(*hang);
  EXPECT_EQ(failure_.get_future().get(), "mapping: it did not end within 0 s");
  EXPECT_FALSE(scheduler_->Offer(testing_support::MakeFrame(2)));
  release.set_value();
  scheduler_->Stop();
  EXPECT_FALSE(finished_);
}

// The thread is blocked in the callback after the first frame while more frames arrive than the queue can hold.
TEST_F(SchedulerTest, LiveModeDropsTheOldestWaitingFrame) {
  std::promise<void> entered, release;
  bool is_first = true;
  Start(FrameMode::kLive, /*single_thread=*/true, [&] {
    if (!std::exchange(is_first, false)) return;
    entered.set_value();
    release.get_future().wait();
  });
  EXPECT_TRUE(scheduler_->Offer(testing_support::MakeFrame(1)));
  const bool is_blocked = entered.get_future().wait_for(testing_support::kTimeout) == std::future_status::ready;
  EXPECT_TRUE(is_blocked) << "the first frame was not processed";
  for (uint64_t id = 2; id <= 4; ++id) EXPECT_TRUE(scheduler_->Offer(testing_support::MakeFrame(id)));
  release.set_value();
  scheduler_->CloseInputs();
  EXPECT_TRUE(testing_support::Eventually([&] { return finished_.load(); }));
  EXPECT_EQ(Counters().frames_dropped, 1u);
  EXPECT_EQ(Counters().frames_processed, 3u);
  for (const FrameAck& ack : ReadAcks()) EXPECT_EQ(ack.accepted, ack.frame_id != 2) << ack.frame_id << " " << ack.error;
  scheduler_->Stop();
}

TEST_F(SchedulerTest, AnExceptionEndsProcessingAndIsReported) {
  Start(FrameMode::kReplay, /*single_thread=*/true, [] { throw std::runtime_error("broken invariant"); });
  EXPECT_TRUE(scheduler_->Offer(testing_support::MakeFrame(1)));
  std::future<std::string> failure = failure_.get_future();
  ASSERT_EQ(failure.wait_for(testing_support::kTimeout), std::future_status::ready) << "no failure was reported";
  EXPECT_EQ(failure.get(), "mapping: broken invariant");
  EXPECT_FALSE(scheduler_->Offer(testing_support::MakeFrame(2)));
  EXPECT_FALSE(finished_);
  scheduler_->Stop();
}

}  // namespace romap::session::scheduler_test
