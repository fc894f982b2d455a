#include "server/session/pipeline.h"

#include <gtest/gtest.h>

#include <optional>
#include <vector>

#include "tests/unit/server/session/pipeline_fixture.h"

namespace romap::session::pipeline_test {

constexpr std::chrono::milliseconds kNoWait{0};

// Everything runs on the thread of the test.
class PipelineTest : public PipelineFixture {
 protected:
  PipelineTest() : PipelineFixture(SingleThread()) {}

  static ServerConfig SingleThread() {
    ServerConfig config;
    config.session.single_thread = true;
    return config;
  }

  void Process(SessionInput input) {
    pipeline_.Process(pipeline_.Check({std::move(input), std::chrono::steady_clock::now()}),
                      [this](MappingStep step) { steps_.push_back(std::move(step)); });
  }
  std::optional<FrameAck> NextAck() {
    while (const auto event = outbox_->Next(kNoWait)) {
      if (const auto* ack = std::get_if<FrameAck>(&*event)) return *ack;
    }
    return std::nullopt;
  }

  std::vector<MappingStep> steps_;
};

TEST_F(PipelineTest, AcknowledgesAFrameBeforeItIsMapped) {
  Process(testing_support::MakeFrame(1));
  const auto ack = NextAck();
  ASSERT_TRUE(ack.has_value());
  EXPECT_TRUE(ack->accepted) << ack->error;
  EXPECT_EQ(Counters().frames_processed, 0u);
  ASSERT_EQ(steps_.size(), 1u);
  EXPECT_EQ(steps_[0].is_keyframe, ack->is_keyframe);
  EXPECT_FALSE(steps_[0].changes_local_map) << "a given pose needs no local map";
  steps_[0].run();
  EXPECT_EQ(Counters().frames_processed, 1u);
}

TEST_F(PipelineTest, RejectedInputsAreNotMapped) {
  FrameInput frame = testing_support::MakeFrame(1);
  frame.image.clear();
  Process(frame);
  const auto ack = NextAck();
  ASSERT_TRUE(ack.has_value());
  EXPECT_FALSE(ack->accepted);
  Process(MasksInput{});
  EXPECT_TRUE(steps_.empty());
  EXPECT_EQ(Counters().frames_rejected, 1u);
}

TEST_F(PipelineTest, LateMasksAreNeverSkipped) {
  Process(testing_support::MakeFrame(1));
  MasksInput masks;
  masks.frame_id = 1;
  static_cast<EncodedMasks&>(masks) = testing_support::MakeFrame(1, "mug");
  Process(masks);
  ASSERT_EQ(steps_.size(), 2u);
  EXPECT_FALSE(steps_[1].may_be_skipped);
  EXPECT_FALSE(steps_[1].changes_local_map);
  for (const MappingStep& step : steps_) step.run();
  bool settled = false;
  ledger_.WhenSettled([&] { settled = true; });
  EXPECT_TRUE(settled);
}

TEST_F(PipelineTest, FinishMappingWithoutObjectsLeavesNothingToTrain) {
  Process(testing_support::MakeFrame(1));
  steps_[0].run();
  pipeline_.FinishMapping();
  EXPECT_TRUE(pipeline_.IsTrainingDone());
  EXPECT_EQ(pipeline_.TrainingProgress().objects_total, 0);
}

}  // namespace romap::session::pipeline_test
