#include "client/sdk/resuming_map_stream.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <thread>

#include "client/sdk/map_copy.h"
#include "common/status.h"
#include "tests/support/fake_mapping_service.h"
#include "tests/support/streams.h"

namespace romap::client::resuming_map_stream_test {

using ::testing::Each;
using ::testing::Pair;
using ::testing::SizeIs;
using testing_support::Eventually;
using testing_support::MakeFrame;
using testing_support::NextOf;
using testing_support::Only;
using testing_support::ReadToEnd;

const absl::Status kBroken = absl::UnavailableError("socket closed");

class ResumingMapStreamTest : public ::testing::Test {
 protected:
  ResumingMapStreamTest() {
    SessionOptions options;
    options.camera = testing_support::SmallCamera();
    session_ = service_.CreateSession(options)->id;
    options_.retry.initial_delay = std::chrono::milliseconds(2);
    options_.retry.max_delay = std::chrono::milliseconds(20);
  }
  void Open() {
    auto stream = ResumingMapStream::Open(&service_, session_, options_);
    ASSERT_TRUE(stream.ok()) << Message(stream.status());
    stream_ = *std::move(stream);
  }
  void Send(uint64_t first, uint64_t last, const std::string& class_name = "") {
    for (uint64_t id = first; id <= last; ++id) ASSERT_TRUE(stream_->Send(MakeFrame(id, class_name)).ok()) << id;
  }
  void ReadAcks(int count) {
    for (int i = 0; i < count; ++i) {
      const auto ack = NextOf<FrameAck>(*stream_);
      ASSERT_TRUE(ack.has_value());
      ++acks_[ack->frame_id];
    }
  }
  size_t FramesOfTheService() { return service_.ExportMap(session_)->trajectory.size(); }

  testing_support::FakeMappingService service_;
  std::string session_;
  ResumeOptions options_;
  std::unique_ptr<ResumingMapStream> stream_;
  std::map<uint64_t, int> acks_;  // number by frame
};

TEST_F(ResumingMapStreamTest, EveryFrameArrivesOnceAndIsAcknowledgedOnceThroughManyBreaks) {
  Open();
  std::thread breaker([&] {
    for (int i = 0; i < 20; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      service_.BreakStreams(kBroken);
    }
  });
  std::thread sender([&] {
    for (uint64_t id = 1; id <= 300; ++id) {
      EXPECT_TRUE(stream_->Send(MakeFrame(id)).ok());
      std::this_thread::sleep_for(std::chrono::microseconds(300));
    }
  });
  ReadAcks(300);
  sender.join();
  breaker.join();
  EXPECT_THAT(acks_, SizeIs(300));
  EXPECT_THAT(acks_, Each(Pair(::testing::_, 1)));
  EXPECT_EQ(FramesOfTheService(), 300u);
  EXPECT_TRUE(stream_->CloseSend().ok());
  EXPECT_THAT(Only<FrameAck>(ReadToEnd(*stream_)), SizeIs(0));
  EXPECT_TRUE(stream_->status().ok()) << Message(stream_->status());
}

TEST_F(ResumingMapStreamTest, InputsAreKeptUntilTheyAreDurable) {
  service_.SetDurable(true);
  Open();
  Send(1, 10);
  ReadAcks(10);
  EXPECT_EQ(stream_->unsettled(), 10u);
  service_.PublishDurable(session_, {.frame_id = 4});
  EXPECT_TRUE(Eventually([&] { return stream_->unsettled() == 6; }));
  service_.Crash(4);
  EXPECT_TRUE(Eventually([&] { return FramesOfTheService() == 10; })) << "frames 5 to 10 are sent again";
  Send(11, 11);
  ReadAcks(1);
  EXPECT_THAT(acks_, SizeIs(11));
  EXPECT_THAT(acks_, Each(Pair(::testing::_, 1)));
  service_.PublishDurable(session_, {.frame_id = 11});
  EXPECT_TRUE(Eventually([&] { return stream_->unsettled() == 0; }));
}

TEST_F(ResumingMapStreamTest, ObjectsThatAreGoneAreReportedAsRemoved) {
  Open();
  client::MapCopy copy;
  const auto read_until = [&](auto condition) {
    EXPECT_TRUE(Eventually([&] {
      while (const auto event = stream_->Next(std::chrono::milliseconds(1))) copy.Apply(*event);
      return condition();
    }));
  };
  Send(1, 1, "mug");
  Send(2, 2, "plant");
  read_until([&] { return copy.objects().size() == 2; });
  service_.Crash(2);  // the objects are gone
  read_until([&] { return copy.objects().empty(); });
  Send(3, 3, "book");
  read_until([&] { return copy.objects().size() == 1; });
  EXPECT_EQ(copy.objects().begin()->second.object.class_name, "book");
}

TEST_F(ResumingMapStreamTest, GivesUpAfterTheLongestDowntime) {
  options_.retry.max_down = std::chrono::milliseconds(100);
  std::vector<std::string> reasons;
  options_.on_link = [&](bool up, const std::string& reason, int) {
    if (!up) reasons.push_back(reason);
  };
  Open();
  service_.RefuseStreams(absl::UnavailableError("no route to host"));
  service_.BreakStreams(kBroken);
  ReadToEnd(*stream_);
  EXPECT_EQ(stream_->status().code(), absl::StatusCode::kUnavailable);
  EXPECT_FALSE(stream_->Send(MakeFrame(1)).ok());
  stream_ = nullptr;
  ASSERT_GE(reasons.size(), 2u);
  EXPECT_EQ(reasons[0], "socket closed");
  EXPECT_EQ(reasons[1], "no route to host");
}

TEST_F(ResumingMapStreamTest, AReasonOfTheServerEndsTheStream) {
  Open();
  EXPECT_TRUE(service_.DeleteSession(session_).ok());
  ReadToEnd(*stream_);
  EXPECT_EQ(stream_->status().code(), absl::StatusCode::kNotFound);
}

TEST_F(ResumingMapStreamTest, ALiveStreamDropsTheOldestFramesThatDoNotFit) {
  options_.drop_oldest = true;
  options_.max_bytes = 10 * MakeFrame(1).image.size();
  Open();
  Send(1, 1);
  ReadAcks(1);
  service_.RefuseStreams(kBroken);
  service_.BreakStreams(kBroken);
  Send(2, 40);
  EXPECT_GT(stream_->dropped(), 25u);
  EXPECT_LT(stream_->unsettled(), 12u);
  service_.RefuseStreams(absl::OkStatus());
  ReadAcks(39);
  EXPECT_THAT(acks_, SizeIs(40)) << "dropped ones are acknowledged, too";
  EXPECT_EQ(FramesOfTheService(), 40 - stream_->dropped());
}

TEST_F(ResumingMapStreamTest, AReplayWaitsWhileTheLinkIsDown) {
  options_.max_waiting = 4;
  Open();
  service_.RefuseStreams(kBroken);
  service_.BreakStreams(kBroken);
  std::atomic<uint64_t> sent = 0;
  std::thread sender([&] {
    for (uint64_t id = 1; id <= 20; ++id) {
      EXPECT_TRUE(stream_->Send(MakeFrame(id)).ok());
      sent = id;
    }
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_LE(sent, 6u);
  service_.RefuseStreams(absl::OkStatus());
  ReadAcks(20);
  sender.join();
  EXPECT_EQ(FramesOfTheService(), 20u);
}

TEST_F(ResumingMapStreamTest, TheEventsOfASessionThatWasFinishedMeanwhileGoOn) {
  Open();
  Send(1, 2, "mug");
  ReadAcks(2);
  service_.RefuseStreams(kBroken);
  service_.BreakStreams(kBroken);
  EXPECT_TRUE(service_.FinishSession(session_).ok());
  service_.RefuseStreams(absl::OkStatus());
  client::MapCopy copy;
  for (const MapEvent& event : ReadToEnd(*stream_)) copy.Apply(event);
  EXPECT_TRUE(stream_->status().ok()) << Message(stream_->status());
  EXPECT_THAT(copy.objects(), SizeIs(1));
}

TEST_F(ResumingMapStreamTest, CancelEndsAWaitForTheLink) {
  Open();
  service_.RefuseStreams(kBroken);
  service_.BreakStreams(kBroken);
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  stream_->Cancel();
  ReadToEnd(*stream_);
  EXPECT_EQ(stream_->status().code(), absl::StatusCode::kCancelled);
}

}  // namespace romap::client::resuming_map_stream_test
