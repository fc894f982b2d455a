// The contract of MappingService for streams.

#include <map>
#include <thread>

#include "tests/contract/contract_fixture.h"

namespace romap::contract::stream_contract_test {

using absl::StatusCode;
using ::testing::SizeIs;

class StreamContract : public MappingServiceContract {};
INSTANTIATE_TEST_SUITE_P(All, StreamContract, ::testing::ValuesIn(AllBackends()),
                         [](const auto& info) { return info.param.name; });

TEST_P(StreamContract, FramesAreAcknowledgedInOrderAndTheStreamEndsWithOk) {
  const auto stream = Open(NewSession());
  constexpr uint64_t kFrames = 40;
  for (uint64_t id = 1; id <= kFrames; ++id) ASSERT_TRUE(stream->Send(testing_support::MakeFrame(id)).ok());
  EXPECT_OK(stream->CloseSend());
  const auto acks = testing_support::Only<FrameAck>(testing_support::ReadToEnd(*stream));
  ASSERT_THAT(acks, SizeIs(kFrames));
  for (uint64_t i = 0; i < kFrames; ++i) {
    EXPECT_EQ(acks[i].frame_id, i + 1);
    EXPECT_TRUE(acks[i].accepted) << acks[i].error;
  }
  EXPECT_TRUE(stream->Done());
  EXPECT_OK(stream->status());
}

TEST_P(StreamContract, InvalidFrameIsRejectedAndTheStreamContinues) {
  const auto stream = Open(NewSession());
  EXPECT_OK(stream->Send(testing_support::MakeFrame(1)));
  FrameInput bad = testing_support::MakeFrame(2);
  bad.image.clear();
  EXPECT_OK(stream->Send(bad));
  EXPECT_OK(stream->Send(testing_support::MakeFrame(3)));
  EXPECT_OK(stream->CloseSend());
  std::map<uint64_t, FrameAck> acks;
  for (const FrameAck& ack : testing_support::Only<FrameAck>(testing_support::ReadToEnd(*stream)))
    acks[ack.frame_id] = ack;
  ASSERT_THAT(acks, SizeIs(3));
  EXPECT_TRUE(acks[1].accepted);
  EXPECT_FALSE(acks[2].accepted);
  EXPECT_FALSE(acks[2].error.empty());
  EXPECT_TRUE(acks[3].accepted) << acks[3].error;
  EXPECT_OK(stream->status());
}

MasksInput MasksOf(uint64_t frame_id, const std::string& class_name) {
  MasksInput masks;
  masks.frame_id = frame_id;
  static_cast<EncodedMasks&>(masks) = testing_support::MakeFrame(frame_id, class_name);
  return masks;
}

TEST_P(StreamContract, LateMasksAreAcknowledgedInOrder) {
  const auto stream = Open(NewSession());
  constexpr uint64_t kFrames = 20, kDelay = 5;
  for (uint64_t id = 1; id <= kFrames + kDelay; ++id) {
    if (id <= kFrames) EXPECT_OK(stream->Send(testing_support::MakeFrame(id)));
    if (id > kDelay) EXPECT_OK(stream->SendMasks(MasksOf(id - kDelay, "mug")));
  }
  EXPECT_OK(stream->CloseSend());
  const auto events = testing_support::ReadToEnd(*stream);
  EXPECT_THAT(testing_support::Only<FrameAck>(events), SizeIs(kFrames));
  const auto acks = testing_support::Only<MasksAck>(events);
  ASSERT_THAT(acks, SizeIs(kFrames)) << "the stream must not end before the last masks are mapped";
  for (uint64_t i = 0; i < kFrames; ++i) {
    EXPECT_EQ(acks[i].frame_id, i + 1);
    EXPECT_TRUE(acks[i].accepted) << acks[i].error;
    EXPECT_EQ(acks[i].error, "");
  }
  EXPECT_OK(stream->status());
}

TEST_P(StreamContract, LateMasksWithoutAMatchingFrameAreRejectedAndTheStreamContinues) {
  const std::string session = NewSession();
  const auto stream = Open(session);
  EXPECT_OK(stream->Send(testing_support::MakeFrame(1, "mug")));
  EXPECT_OK(stream->Send(testing_support::MakeFrame(2)));
  EXPECT_OK(stream->SendMasks(MasksOf(1, "mug")));  // frame 1 has masks
  EXPECT_OK(stream->SendMasks(MasksOf(2, "mug")));
  EXPECT_OK(stream->SendMasks(MasksOf(2, "mug")));  // frame 2 now has masks
  EXPECT_OK(stream->SendMasks(MasksOf(9, "mug")));  // not sent yet
  EXPECT_OK(stream->Send(testing_support::MakeFrame(3)));
  EXPECT_OK(stream->CloseSend());
  const auto events = testing_support::ReadToEnd(*stream);
  const auto acks = testing_support::Only<MasksAck>(events);
  ASSERT_THAT(acks, SizeIs(4));
  for (size_t i = 0; i < acks.size(); ++i) {
    EXPECT_EQ(acks[i].accepted, i == 1) << i;
    EXPECT_EQ(acks[i].error.empty(), i == 1) << i;
  }
  EXPECT_THAT(testing_support::Only<FrameAck>(events), SizeIs(3));
  EXPECT_OK(stream->status());
  EXPECT_EQ(service().GetSession(session)->statistics.frames_received, 3u) << "late masks do not count as frames";
}

TEST_P(StreamContract, LateMasksCreateObjects) {
  if (!GetParam().objects_from_one_frame) GTEST_SKIP() << "this service needs frames of a consistent scene";
  const auto stream = Open(NewSession());
  EXPECT_OK(stream->Send(testing_support::MakeFrame(1)));
  EXPECT_OK(stream->SendMasks(MasksOf(1, "mug")));
  const auto object = testing_support::NextOf<ObjectUpdate>(*stream);
  ASSERT_TRUE(object.has_value());
  EXPECT_EQ(object->class_name, "mug");
}

TEST_P(StreamContract, LiveSessionAcknowledgesAllFramesAndMasks) {
  SessionOptions options;
  options.camera = testing_support::SmallCamera();
  options.mode = FrameMode::kLive;
  const auto stream = Open(service().CreateSession(options)->id);
  constexpr uint64_t kFrames = 60;
  for (uint64_t id = 1; id <= kFrames; ++id) {
    EXPECT_OK(stream->Send(testing_support::MakeFrame(id)));
    EXPECT_OK(stream->SendMasks(MasksOf(id, "mug")));
  }
  EXPECT_OK(stream->CloseSend());
  const auto events = testing_support::ReadToEnd(*stream);
  EXPECT_THAT(testing_support::Only<FrameAck>(events), SizeIs(kFrames)) << "accepted or dropped";
  EXPECT_THAT(testing_support::Only<MasksAck>(events), SizeIs(kFrames));
}

TEST_P(StreamContract, FrameWithANonFinitePoseIsRejected) {
  const auto stream = Open(NewSession());
  FrameInput frame = testing_support::MakeFrame(1);
  frame.T_world_camera.emplace(Eigen::Quaterniond::Identity(), Eigen::Vector3d(std::nan(""), 0, 0));
  EXPECT_OK(stream->Send(frame));
  EXPECT_OK(stream->CloseSend());
  const auto acks = testing_support::Only<FrameAck>(testing_support::ReadToEnd(*stream));
  ASSERT_THAT(acks, SizeIs(1));
  // The fake does not check poses. Over gRPC, the transport rejects the frame.
  EXPECT_EQ(acks[0].accepted, GetParam().name == "Fake") << acks[0].error;
}

TEST_P(StreamContract, SecondMapStreamIsRejected) {
  const std::string session = NewSession();
  const auto stream = Open(session);
  EXPECT_TRUE(service().GetSession(session)->stream_open);
  EXPECT_CODE(service().OpenMap(session).status(), StatusCode::kFailedPrecondition);
  EXPECT_OK(stream->Send(testing_support::MakeFrame(1)));
  EXPECT_TRUE(testing_support::NextOf<FrameAck>(*stream).has_value());
}

TEST_P(StreamContract, SessionAcceptsOneStreamAfterAnother) {
  const std::string session = NewSession();
  for (uint64_t id = 1; id <= 3; ++id) {
    const auto stream = Reopen(session);
    ASSERT_NE(stream, nullptr);
    EXPECT_OK(stream->Send(testing_support::MakeFrame(id)));
    EXPECT_OK(stream->CloseSend());
    testing_support::ReadToEnd(*stream);
    EXPECT_OK(stream->status());
  }
  EXPECT_THAT(service().ExportMap(session)->trajectory, SizeIs(3));
}

TEST_P(StreamContract, ResumeTokenReplacesTheStreamAndResentInputsAreDuplicates) {
  const std::string session = NewSession();
  const auto lost = Open(session);
  EXPECT_FALSE(lost->opening().resume_token.empty());
  EXPECT_EQ(lost->opening().newest_frame_id, std::nullopt);
  for (uint64_t id = 1; id <= 3; ++id) EXPECT_OK(lost->Send(MakeFrame(id)));
  EXPECT_OK(lost->SendMasks(MasksOf(2, "mug")));
  EXPECT_TRUE(NextOf<MasksAck>(*lost).has_value());
  EXPECT_CODE(service().OpenMap(session, "another token").status(), StatusCode::kFailedPrecondition);

  auto resumed = service().OpenMap(session, lost->opening().resume_token);
  ASSERT_TRUE(resumed.ok()) << Message(resumed.status());
  MapStream& stream = **resumed;
  ReadToEnd(*lost);
  EXPECT_CODE(lost->status(), StatusCode::kAborted);
  EXPECT_FALSE(lost->Send(MakeFrame(4)).ok());
  EXPECT_EQ(stream.opening().newest_frame_id, 3u);
  EXPECT_EQ(stream.opening().resume_token, lost->opening().resume_token);

  for (uint64_t id = 2; id <= 4; ++id) {
    FrameInput frame = MakeFrame(id);
    frame.resent = id < 4;
    EXPECT_OK(stream.Send(frame));
  }
  MasksInput masks = MasksOf(2, "mug");
  masks.resent = true;
  EXPECT_OK(stream.SendMasks(masks));
  EXPECT_OK(stream.CloseSend());
  const auto events = ReadToEnd(stream);
  const auto acks = Only<FrameAck>(events);
  ASSERT_THAT(acks, SizeIs(3));
  for (const FrameAck& ack : acks) {
    EXPECT_TRUE(ack.accepted) << ack.error;
    EXPECT_EQ(ack.duplicate, ack.frame_id < 4) << ack.frame_id;
  }
  const auto masks_acks = Only<MasksAck>(events);
  ASSERT_THAT(masks_acks, SizeIs(1));
  EXPECT_TRUE(masks_acks[0].accepted && masks_acks[0].duplicate);
  EXPECT_THAT(service().ExportMap(session)->trajectory, SizeIs(4));
  EXPECT_EQ(service().GetSession(session)->statistics.frames_received, 4u);
}

TEST_P(StreamContract, TheOpeningListsTheObjects) {
  if (!GetParam().objects_from_one_frame) GTEST_SKIP() << "this service needs frames of a consistent scene";
  const std::string session = NewSession();
  const auto stream = Open(session);
  EXPECT_THAT(stream->opening().objects, SizeIs(0));
  EXPECT_OK(stream->Send(MakeFrame(1, "mug")));
  const auto object = NextOf<ObjectUpdate>(*stream);
  ASSERT_TRUE(object.has_value());
  const auto watch = service().Watch(session);
  ASSERT_TRUE(watch.ok());
  EXPECT_THAT((*watch)->opening().objects, ::testing::ElementsAre(object->id));
  EXPECT_EQ((*watch)->opening().newest_frame_id, 1u);
  EXPECT_EQ((*watch)->opening().resume_token, "");
}

TEST_P(StreamContract, FinishedSessionRejectsMapStreams) {
  const std::string session = NewSession();
  EXPECT_OK(service().FinishSession(session).status());
  EXPECT_CODE(service().OpenMap(session).status(), StatusCode::kFailedPrecondition);
}

TEST_P(StreamContract, SendFailsAfterCloseSend) {
  const auto stream = Open(NewSession());
  EXPECT_OK(stream->CloseSend());
  EXPECT_CODE(stream->Send(testing_support::MakeFrame(1)), StatusCode::kFailedPrecondition);
  EXPECT_CODE(stream->SendMasks(MasksOf(1, "mug")), StatusCode::kFailedPrecondition);
  EXPECT_CODE(stream->CloseSend(), StatusCode::kFailedPrecondition);
  testing_support::ReadToEnd(*stream);
  EXPECT_OK(stream->status());
}

TEST_P(StreamContract, DisconnectKeepsTheSession) {
  const std::string session = NewSession();
  {
    const auto stream = Open(session);
    for (uint64_t id = 1; id <= 3; ++id) EXPECT_OK(stream->Send(testing_support::MakeFrame(id)));
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(testing_support::NextOf<FrameAck>(*stream).has_value());
  }
  EXPECT_EQ(service().GetSession(session)->state, SessionState::kOpen);
  const auto stream = Reopen(session);
  ASSERT_NE(stream, nullptr);
  EXPECT_OK(stream->Send(testing_support::MakeFrame(4)));
  EXPECT_OK(stream->CloseSend());
  testing_support::ReadToEnd(*stream);
  EXPECT_THAT(service().ExportMap(session)->trajectory, SizeIs(4));
}

TEST_P(StreamContract, FinishEndsOpenStreams) {
  const std::string session = NewSession();
  const auto stream = Open(session);
  const auto watch = service().Watch(session);
  ASSERT_TRUE(watch.ok());
  EXPECT_OK(stream->Send(testing_support::MakeFrame(1)));
  EXPECT_TRUE(testing_support::NextOf<FrameAck>(*stream).has_value());
  EXPECT_OK(service().FinishSession(session).status());
  testing_support::ReadToEnd(*stream);
  testing_support::ReadToEnd(**watch);
  EXPECT_OK(stream->status());
  EXPECT_OK((*watch)->status());
  EXPECT_CODE(stream->Send(testing_support::MakeFrame(2)), StatusCode::kFailedPrecondition);
}

TEST_P(StreamContract, DeleteEndsOpenStreams) {
  const std::string session = NewSession();
  const auto stream = Open(session);
  const auto watch = service().Watch(session);
  ASSERT_TRUE(watch.ok());
  EXPECT_OK(stream->Send(testing_support::MakeFrame(1)));
  EXPECT_OK(service().DeleteSession(session));
  testing_support::ReadToEnd(*stream);
  testing_support::ReadToEnd(**watch);
  EXPECT_CODE((*watch)->status(), StatusCode::kNotFound);
  EXPECT_FALSE(stream->status().ok());
  EXPECT_FALSE(stream->Send(testing_support::MakeFrame(2)).ok());
  EXPECT_CODE(service().OpenMap(session).status(), StatusCode::kNotFound);
}

TEST_P(StreamContract, DeleteDuringSendEndsSenderAndReader) {
  const std::string session = NewSession();
  const auto stream = Open(session);
  std::thread sender([&] {
    for (uint64_t id = 1; stream->Send(testing_support::MakeFrame(id)).ok(); ++id) {
    }
  });
  EXPECT_TRUE(testing_support::NextOf<FrameAck>(*stream).has_value());
  EXPECT_OK(service().DeleteSession(session));
  testing_support::ReadToEnd(*stream);
  sender.join();
  EXPECT_CODE(service().GetSession(session).status(), StatusCode::kNotFound);
}

TEST_P(StreamContract, CancelEndsAWaitingReader) {
  const auto stream = Open(NewSession());
  std::thread reader([&] { testing_support::ReadToEnd(*stream); });
  stream->Cancel();
  reader.join();
  EXPECT_TRUE(stream->Done());
  EXPECT_CODE(stream->status(), StatusCode::kCancelled);
  EXPECT_FALSE(stream->Send(testing_support::MakeFrame(1)).ok());
}

TEST_P(StreamContract, WatchReceivesFrameAcks) {
  const std::string session = NewSession();
  const auto watch = service().Watch(session);
  ASSERT_TRUE(watch.ok());
  const auto stream = Open(session);
  EXPECT_OK(stream->Send(testing_support::MakeFrame(1)));
  const auto ack = testing_support::NextOf<FrameAck>(**watch);
  ASSERT_TRUE(ack.has_value());
  EXPECT_EQ(ack->frame_id, 1u);
  EXPECT_TRUE(ack->T_world_camera.has_value());
}

TEST_P(StreamContract, WatchOfAFinishedSessionEnds) {
  const std::string session = NewSession();
  EXPECT_OK(service().FinishSession(session).status());
  const auto watch = service().Watch(session);
  ASSERT_TRUE(watch.ok());
  testing_support::ReadToEnd(**watch);
  EXPECT_OK((*watch)->status());
}

TEST_P(StreamContract, WatchStartsWithTheCurrentObjects) {
  if (!GetParam().objects_from_one_frame) GTEST_SKIP() << "this service needs frames of a consistent scene";
  const std::string session = NewSession();
  const auto stream = Open(session);
  EXPECT_OK(stream->Send(testing_support::MakeFrame(1, "mug")));
  ASSERT_TRUE(testing_support::NextOf<MeshUpdate>(*stream).has_value());

  const auto watch = service().Watch(session);
  ASSERT_TRUE(watch.ok());
  const auto object = testing_support::NextOf<ObjectUpdate>(**watch);
  const auto mesh = testing_support::NextOf<MeshUpdate>(**watch);
  ASSERT_TRUE(object && mesh);
  EXPECT_EQ(object->class_name, "mug");
  EXPECT_EQ(mesh->id, object->id);

  EXPECT_OK(stream->Send(testing_support::MakeFrame(2, "mug")));
  const auto newer = testing_support::NextOf<ObjectUpdate>(**watch);
  ASSERT_TRUE(newer.has_value());
  EXPECT_EQ(newer->id, object->id);
  EXPECT_GT(newer->revision, object->revision);
}

TEST_P(StreamContract, SessionsAreIndependent) {
  constexpr uint64_t kFrames = 20;
  const auto run = [&](uint64_t first_id, std::vector<FrameAck>* acks) {
    const std::string session = NewSession();
    const auto stream = Open(session);
    for (uint64_t id = first_id; id < first_id + kFrames; ++id) EXPECT_OK(stream->Send(testing_support::MakeFrame(id)));
    EXPECT_OK(stream->CloseSend());
    *acks = testing_support::Only<FrameAck>(testing_support::ReadToEnd(*stream));
    EXPECT_THAT(service().ExportMap(session)->trajectory, SizeIs(kFrames));
  };
  std::vector<FrameAck> a, b;
  std::thread other([&] { run(1000, &b); });
  run(1, &a);
  other.join();
  ASSERT_THAT(a, SizeIs(kFrames));
  ASSERT_THAT(b, SizeIs(kFrames));
  for (uint64_t i = 0; i < kFrames; ++i) {
    EXPECT_EQ(a[i].frame_id, 1 + i);
    EXPECT_EQ(b[i].frame_id, 1000 + i);
  }
}

}  // namespace romap::contract::stream_contract_test
