#include "server/session/frame_ledger.h"

#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>
#include <sstream>

#include "common/status.h"

namespace romap::session::frame_ledger_test {

constexpr std::chrono::milliseconds kNoWait{0};

Arrival FrameArrival(uint64_t frame_id) {
  FrameInput frame;
  frame.frame_id = frame_id;
  return {frame, std::chrono::steady_clock::now()};
}

Arrival MasksArrival(uint64_t frame_id) {
  MasksInput masks;
  masks.frame_id = frame_id;
  return {masks, std::chrono::steady_clock::now()};
}

class FrameLedgerTest : public ::testing::Test {
 protected:
  FrameAck NextFrameAck() { return std::get<FrameAck>(outbox_->Next(kNoWait).value()); }
  MasksAck NextMasksAck() { return std::get<MasksAck>(outbox_->Next(kNoWait).value()); }
  Statistics Counters() const {
    Statistics statistics;
    ledger_.FillIn(&statistics);
    return statistics;
  }

  MapState map_;
  std::shared_ptr<Outbox> outbox_ = map_.Subscribe(Outbox::Acks::kAll, 100);
  FrameLedger ledger_{"session", &map_};
};

TEST_F(FrameLedgerTest, AcknowledgesAFrameWithItsTrackingResult) {
  TrackedFrame tracked;
  tracked.state = TrackingState::kRelocalized;
  tracked.T_world_camera = {Eigen::Quaterniond::Identity(), Eigen::Vector3d(1, 2, 3)};
  tracked.is_keyframe = true;
  ledger_.AcknowledgeFrame(FrameArrival(7), tracked);
  const FrameAck ack = NextFrameAck();
  EXPECT_EQ(ack.frame_id, 7u);
  EXPECT_TRUE(ack.accepted);
  EXPECT_EQ(ack.state, TrackingState::kRelocalized);
  ASSERT_TRUE(ack.T_world_camera.has_value());
  EXPECT_EQ(ack.T_world_camera->translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(ack.is_keyframe);
  EXPECT_GE(ack.latency_s, 0);
  EXPECT_EQ(map_.Snapshot().trajectory.size(), 1u);
}

TEST_F(FrameLedgerTest, AcknowledgesALostFrameWithoutPose) {
  TrackedFrame tracked;
  tracked.state = TrackingState::kLost;
  tracked.reason = "too few matches";
  ledger_.AcknowledgeFrame(FrameArrival(1), tracked);
  const FrameAck ack = NextFrameAck();
  EXPECT_TRUE(ack.accepted);
  EXPECT_FALSE(ack.T_world_camera.has_value());
  EXPECT_EQ(ack.state_reason, "too few matches");
}

TEST_F(FrameLedgerTest, RejectedAndDroppedInputsAreAcknowledgedWithTheReason) {
  ledger_.Reject(FrameArrival(1), InvalidArgument("image: missing"));
  const FrameAck rejected = NextFrameAck();
  EXPECT_FALSE(rejected.accepted);
  EXPECT_EQ(rejected.error, "image: missing");
  ledger_.Reject(MasksArrival(1), InvalidArgument("masks: missing"));
  EXPECT_EQ(NextMasksAck().error, "masks: missing");
  ledger_.Drop(FrameArrival(2));
  const FrameAck dropped = NextFrameAck();
  EXPECT_FALSE(dropped.accepted);
  EXPECT_EQ(dropped.frame_id, 2u);
  EXPECT_EQ(Counters().frames_rejected, 1u) << "late masks do not count as frames";
  EXPECT_EQ(Counters().frames_dropped, 1u);
}

TEST_F(FrameLedgerTest, CountsFramesKeyframesAndMapPoints) {
  for (int i = 0; i < 2; ++i) ledger_.CountReceived(/*is_frame=*/true);
  ledger_.CountReceived(/*is_frame=*/false);
  ledger_.CountMappedFrame(/*is_keyframe=*/true, 100);
  ledger_.CountMappedFrame(/*is_keyframe=*/false, 120);
  ledger_.CountMappedMasks();
  EXPECT_EQ(Counters().frames_received, 2u);
  EXPECT_EQ(Counters().frames_processed, 2u);
  EXPECT_EQ(Counters().keyframes, 1u);
  EXPECT_EQ(Counters().map_points, 120u);
}

TEST_F(FrameLedgerTest, WhenSettledWaitsForEarlierInputsOnly) {
  bool first_done = false, second_done = false;
  ledger_.WhenSettled([&] { first_done = true; });
  EXPECT_TRUE(first_done) << "no input was received";
  first_done = false;
  for (int i = 0; i < 3; ++i) ledger_.CountReceived(/*is_frame=*/true);
  ledger_.WhenSettled([&] { first_done = true; });
  ledger_.CountReceived(/*is_frame=*/false);
  ledger_.WhenSettled([&] { second_done = true; });
  ledger_.CountMappedFrame(/*is_keyframe=*/false, 0);
  ledger_.SkipMapping();
  EXPECT_FALSE(first_done);
  ledger_.Drop(FrameArrival(3));
  EXPECT_TRUE(first_done);
  EXPECT_FALSE(second_done);
  ledger_.CountMappedMasks();
  EXPECT_TRUE(second_done);
}

TEST_F(FrameLedgerTest, SettleAllEndsAllWaits) {
  bool done = false, later_done = false;
  ledger_.CountReceived(/*is_frame=*/true);
  ledger_.WhenSettled([&] { done = true; });
  ledger_.SettleAll();
  EXPECT_TRUE(done);
  ledger_.CountReceived(/*is_frame=*/true);
  ledger_.WhenSettled([&] { later_done = true; });
  EXPECT_TRUE(later_done);
}

TEST_F(FrameLedgerTest, LogsFewOfManyRejections) {
  std::ostringstream log;
  const auto before = spdlog::default_logger();
  spdlog::set_default_logger(
      std::make_shared<spdlog::logger>("", std::make_shared<spdlog::sinks::ostream_sink_mt>(log)));
  for (uint64_t id = 1; id <= 2500; ++id) ledger_.Reject(FrameArrival(id), InvalidArgument("image: missing"));
  for (uint64_t id = 1; id <= 15; ++id) ledger_.Reject(MasksArrival(id), InvalidArgument("masks: missing"));
  spdlog::set_default_logger(before);
  const std::string text = log.str();
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 6);
  EXPECT_NE(text.find("session session: frame 1 rejected: image: missing"), std::string::npos) << text;
  EXPECT_NE(text.find("session session: frame 1000 rejected, the 1000th: image: missing"), std::string::npos) << text;
  EXPECT_NE(text.find("session session: masks of frame 10 rejected, the 10th: masks: missing"), std::string::npos);
}

}  // namespace romap::session::frame_ledger_test
