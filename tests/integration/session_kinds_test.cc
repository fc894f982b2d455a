// Sessions of several kinds whose server is killed half-way.

#include <gmock/gmock.h>

#include <map>
#include <numeric>
#include <thread>

#include "client/files/sequence.h"
#include "client/sdk/resuming_map_stream.h"
#include "client/sdk/retry.h"
#include "client/synth/synth.h"
#include "tests/integration/recording_client.h"
#include "tests/integration/server_process.h"

namespace romap::session_kinds_test {

using ::testing::SizeIs;

constexpr int kFrames = 30;
constexpr int kObjects = 2;
constexpr size_t kMasksDelay = 5;  // frames

struct Kind {
  const char* name;
  FrameMode mode = FrameMode::kReplay;
  bool has_late_masks = false;
  bool has_depth = false;
  synth::SynthLens lens = synth::SynthLens::kPinhole;
};

class SessionKindTest : public ::testing::TestWithParam<Kind> {
 protected:
  void SetUp() override {
    synth::SynthOptions options{
        .seed = 3, .objects = kObjects, .frames = kFrames, .width_px = 160, .height_px = 120, .lens = GetParam().lens};
    ASSERT_TRUE(synth::MakeSequence(options, folder_ / "sequence").ok());
    auto opened = files::Sequence::Open(folder_ / "sequence", {.use_depth = GetParam().has_depth});
    ASSERT_TRUE(opened.ok()) << Message(opened.status());
    sequence_ = std::make_unique<files::Sequence>(*std::move(opened));
    service_ = server_.Connect();
    SessionOptions session;
    session.camera = sequence_->camera();
    session.mode = GetParam().mode;
    session_ = service_->CreateSession(session)->id;
  }

  // Sends the frames with index `first` to `end` - 1, and the masks that are due by then.
  void Send(MapStream& stream, size_t first, size_t end) {
    const auto start = std::chrono::steady_clock::now();
    for (size_t i = first; i < end; ++i) {
      FrameInput frame = sequence_->Load(i).value();
      if (GetParam().has_late_masks) {
        MasksInput& masks = late_[i + kMasksDelay];
        masks.frame_id = frame.frame_id;
        static_cast<EncodedMasks&>(masks) = std::exchange(static_cast<EncodedMasks&>(frame), {});
      }
      std::this_thread::sleep_until(start + integration::kFramePeriod * (i - first));
      EXPECT_OK(stream.Send(std::move(frame)));
      SendMasksDueBy(stream, i);
    }
  }
  void SendMasksDueBy(MapStream& stream, size_t index) {
    while (!late_.empty() && late_.begin()->first <= index) {
      EXPECT_OK(stream.SendMasks(std::move(late_.begin()->second)));
      late_.erase(late_.begin());
    }
  }

  testing_support::TemporaryFolder folder_;
  integration::ServerProcess server_{folder_ / "data"};
  std::unique_ptr<files::Sequence> sequence_;
  std::unique_ptr<client::RemoteMappingService> service_;
  std::string session_;
  std::map<size_t, MasksInput> late_;  // by the index of the frame after which they are sent
};
INSTANTIATE_TEST_SUITE_P(
    All, SessionKindTest,
    ::testing::Values(Kind{.name = "LiveWithLateMasks", .mode = FrameMode::kLive, .has_late_masks = true},
                      Kind{.name = "Distorted", .lens = synth::SynthLens::kRadialTangential},
                      Kind{.name = "WithDepth", .has_depth = true}),
    [](const auto& info) { return info.param.name; });

TEST_P(SessionKindTest, NothingIsLostWhenTheServerIsKilled) {
  auto opened = client::ResumingMapStream::Open(service_.get(), session_);
  ASSERT_TRUE(opened.ok()) << Message(opened.status());
  client::ResumingMapStream* const stream = opened->get();
  integration::RecordingClient recorder(*std::move(opened));
  Send(*stream, 0, kFrames / 2);
  server_.KillAndStart();
  Send(*stream, kFrames / 2, kFrames);
  SendMasksDueBy(*stream, kFrames + kMasksDelay);
  EXPECT_TRUE(testing_support::Eventually([&] { return stream->unsettled() == 0; }));
  EXPECT_OK(client::RetryWhileUnavailable([&] { return service_->FinishSession(session_); }).status());
  ASSERT_TRUE(recorder.WaitForEnd());
  EXPECT_OK(stream->status());

  const bool is_live = GetParam().mode == FrameMode::kLive;  // then a busy server may drop some
  const std::vector<uint64_t> accepted = recorder.AcceptedFrames(/*may_drop=*/is_live);
  EXPECT_THAT(recorder.frame_acks(), SizeIs(kFrames));
  if (!is_live) {
    EXPECT_THAT(accepted, SizeIs(kFrames));
  }
  size_t with_depth = 0;
  const integration::StoredIds stored = integration::StoredInputs(*service_, session_, [&](const SessionInput& input) {
    const auto* frame = std::get_if<FrameInput>(&input);
    if (frame != nullptr && !frame->depth.empty()) ++with_depth;
  });
  EXPECT_EQ(stored.frames, accepted);
  EXPECT_EQ(stored.masks, recorder.AcceptedMasks(/*may_drop=*/is_live));
  EXPECT_EQ(stored.masks.empty(), !GetParam().has_late_masks);
  EXPECT_EQ(with_depth, GetParam().has_depth ? kFrames : 0);
  EXPECT_TRUE(service_->GetSession(session_)->camera == sequence_->camera());
  const MapSnapshot map = service_->ExportMap(session_).value();
  EXPECT_THAT(map.objects, SizeIs(kObjects));
  EXPECT_THAT(map.trajectory, SizeIs(accepted.size()));
  integration::ExpectEqual(recorder.copy(), map);
}

}  // namespace romap::session_kinds_test
