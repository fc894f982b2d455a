// The contract of MappingService for sessions.

#include "tests/contract/contract_fixture.h"

namespace romap::contract::session_contract_test {

using absl::StatusCode;
using ::testing::SizeIs;

class SessionContract : public MappingServiceContract {};
INSTANTIATE_TEST_SUITE_P(All, SessionContract, ::testing::ValuesIn(AllBackends()),
                         [](const auto& info) { return info.param.name; });

TEST_P(SessionContract, SessionsAreCreatedListedAndDeleted) {
  const std::string first = NewSession(), second = NewSession();
  EXPECT_NE(first, second);
  EXPECT_THAT(service().ListSessions().value(), SizeIs(2));
  EXPECT_OK(service().DeleteSession(first));
  const auto remaining = service().ListSessions();
  ASSERT_THAT(remaining.value(), SizeIs(1));
  EXPECT_EQ(remaining->front().id, second);
}

TEST_P(SessionContract, InfoReturnsTheOptions) {
  SessionOptions options;
  options.name = "café, second attempt";
  options.camera = testing_support::SmallCamera();
  options.camera.distortion = {0.1, -0.2, 0.001, 0.002, 0.05};
  options.mode = FrameMode::kLive;
  const auto created = service().CreateSession(options);
  ASSERT_TRUE(created.ok());
  const auto info = service().GetSession(created->id);
  ASSERT_TRUE(info.ok());
  EXPECT_EQ(info->name, options.name);
  EXPECT_EQ(info->camera, options.camera);
  EXPECT_EQ(info->mode, FrameMode::kLive);
  EXPECT_EQ(info->state, SessionState::kOpen);
  EXPECT_FALSE(info->stream_open);
  EXPECT_GT(info->created_unix_ns, 0);
}

TEST_P(SessionContract, UnknownSessionIsNotFound) {
  EXPECT_CODE(service().GetSession("unknown").status(), StatusCode::kNotFound);
  EXPECT_CODE(service().FinishSession("unknown").status(), StatusCode::kNotFound);
  EXPECT_CODE(service().DeleteSession("unknown"), StatusCode::kNotFound);
  EXPECT_CODE(service().OpenMap("unknown").status(), StatusCode::kNotFound);
  EXPECT_CODE(service().Watch("unknown").status(), StatusCode::kNotFound);
  EXPECT_CODE(service().ExportMap("unknown").status(), StatusCode::kNotFound);
}

TEST_P(SessionContract, ErrorContainsTheSessionId) {
  EXPECT_THAT(Message(service().GetSession("unknown").status()), ::testing::HasSubstr("unknown"));
}

TEST_P(SessionContract, InvalidCameraIsRejected) {
  SessionOptions options;
  options.camera = testing_support::SmallCamera();
  options.camera.fx_px = -1;
  EXPECT_CODE(service().CreateSession(options).status(), StatusCode::kInvalidArgument);
  options.camera = testing_support::SmallCamera();
  options.camera.width_px = 0;
  EXPECT_CODE(service().CreateSession(options).status(), StatusCode::kInvalidArgument);
  options.camera = testing_support::SmallCamera();
  options.camera.distortion[2] = std::nan("");
  EXPECT_CODE(service().CreateSession(options).status(), StatusCode::kInvalidArgument);
  EXPECT_THAT(service().ListSessions().value(), SizeIs(0));
}

TEST_P(SessionContract, FinishedSessionExistsUntilItIsDeleted) {
  const std::string session = NewSession();
  const auto finishing = service().FinishSession(session);
  ASSERT_TRUE(finishing.ok());
  EXPECT_NE(finishing->state, SessionState::kOpen);
  EXPECT_TRUE(
      testing_support::Eventually([&] { return service().GetSession(session)->state == SessionState::kFinished; }));
  EXPECT_OK(service().FinishSession(session).status());
  EXPECT_OK(service().ExportMap(session).status());
  EXPECT_OK(service().DeleteSession(session));
  EXPECT_CODE(service().GetSession(session).status(), StatusCode::kNotFound);
}

TEST_P(SessionContract, ExportContainsTheTrajectory) {
  const std::string session = NewSession();
  const auto stream = Open(session);
  for (uint64_t id = 1; id <= 5; ++id) EXPECT_OK(stream->Send(testing_support::MakeFrame(id)));
  EXPECT_OK(stream->CloseSend());
  testing_support::ReadToEnd(*stream);
  const auto map = service().ExportMap(session);
  ASSERT_TRUE(map.ok()) << Message(map.status());
  EXPECT_EQ(map->session_id, session);
  ASSERT_THAT(map->trajectory, SizeIs(5));
  ASSERT_THAT(map->timestamps_ns, SizeIs(5));
  for (uint64_t i = 0; i < 5; ++i) {
    EXPECT_EQ(map->trajectory[i].frame_id, i + 1);
    EXPECT_EQ(map->timestamps_ns[i], testing_support::MakeFrame(i + 1).timestamp_ns);
    ASSERT_TRUE(map->trajectory[i].T_world_camera.has_value());
    EXPECT_NEAR(map->trajectory[i].T_world_camera->translation().x(), 0.01 * (i + 1), 1e-12);
  }
  EXPECT_EQ(map->statistics.frames_received, 5u);
}

TEST_P(SessionContract, ExportContainsTheObjects) {
  if (!GetParam().objects_from_one_frame) GTEST_SKIP() << "this service needs frames of a consistent scene";
  const std::string session = NewSession();
  const auto stream = Open(session);
  EXPECT_OK(stream->Send(testing_support::MakeFrame(1, "mug")));
  EXPECT_OK(stream->Send(testing_support::MakeFrame(2, "book")));
  EXPECT_OK(stream->CloseSend());
  testing_support::ReadToEnd(*stream);
  const auto map = service().ExportMap(session);
  ASSERT_TRUE(map.ok());
  ASSERT_THAT(map->objects, SizeIs(2));
  EXPECT_EQ(map->objects[0].object.class_name, "mug");
  EXPECT_EQ(map->objects[1].object.class_name, "book");
  ASSERT_TRUE(map->objects[0].mesh.has_value());
  EXPECT_EQ(map->objects[0].mesh->id, map->objects[0].object.id);
  EXPECT_FALSE(map->objects[0].mesh->draco.empty());
  EXPECT_TRUE(map->objects[0].object.T_world_mesh.has_value());
}

TEST_P(SessionContract, ASavedSessionIsLoadedWithAnotherId) {
  const std::string session = NewSession("kitchen");
  std::string file;
  const auto write = [&](const std::string& piece) {
    file += piece;
    return absl::OkStatus();
  };
  if (!GetParam().stores_sessions) {
    EXPECT_CODE(service().SaveSession(session, write), StatusCode::kFailedPrecondition);
    EXPECT_CODE(service().LoadSession([] { return std::string(); }).status(), StatusCode::kFailedPrecondition);
    EXPECT_CODE(service().PinSession(session, true).status(), StatusCode::kFailedPrecondition);
    EXPECT_FALSE(service().GetSession(session)->durable);
    return;
  }
  EXPECT_TRUE(service().GetSession(session)->durable);
  {
    const auto stream = Open(session);
    EXPECT_TRUE(stream->opening().durable);
    for (uint64_t id = 1; id <= 3; ++id) EXPECT_OK(stream->Send(MakeFrame(id)));
    EXPECT_OK(stream->CloseSend());
    ReadToEnd(*stream);
  }
  EXPECT_OK(service().SaveSession(session, write));
  bool was_read = false;
  const auto loaded =
      service().LoadSession([&]() -> absl::StatusOr<std::string> { return std::exchange(was_read, true) ? "" : file; });
  ASSERT_TRUE(loaded.ok()) << Message(loaded.status());
  EXPECT_NE(loaded->id, session);
  EXPECT_EQ(loaded->name, "kitchen");
  EXPECT_EQ(loaded->state, SessionState::kOpen);
  EXPECT_GT(loaded->stored_bytes, 3u * 64 * 48);
  EXPECT_EQ(service().ListSessions()->size(), 2u);
  EXPECT_EQ(service().ExportMap(loaded->id)->trajectory.size(), 3u);
  const auto continued = Reopen(loaded->id);
  ASSERT_NE(continued, nullptr);
  EXPECT_EQ(continued->opening().newest_frame_id, 3u);
  EXPECT_CODE(service().LoadSession([] { return std::string(); }).status(), StatusCode::kInvalidArgument);
  EXPECT_CODE(service().SaveSession("unknown", write), StatusCode::kNotFound);
}

TEST_P(SessionContract, SessionsCanBePinned) {
  if (!GetParam().stores_sessions) GTEST_SKIP() << "this service stores no sessions";
  const std::string session = NewSession();
  EXPECT_FALSE(service().GetSession(session)->pinned);
  EXPECT_TRUE(service().PinSession(session, true)->pinned);
  EXPECT_TRUE(service().GetSession(session)->pinned);
  EXPECT_FALSE(service().PinSession(session, false)->pinned);
  EXPECT_CODE(service().PinSession("unknown", true).status(), StatusCode::kNotFound);
}

}  // namespace romap::contract::session_contract_test
