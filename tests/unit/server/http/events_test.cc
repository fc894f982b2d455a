// Event streams and frames over HTTP, with a fake service.

#include <sys/socket.h>

#include "tests/unit/server/http/http_fixture.h"

namespace romap::http::events_test {

using ::testing::HasSubstr;
using testing_support::Eventually;
using testing_support::MakeFrame;

class EventsTest : public HttpFixture {};

TEST_F(EventsTest, BeginWithTheMapAndEndWithTheSession) {
  Start();
  const std::string id = NewMap({"cup"});
  const auto stream = Watch(id);
  ASSERT_NE(stream, nullptr);
  const auto opened = stream->NextEvent();
  ASSERT_TRUE(opened);
  EXPECT_EQ(opened->name, "opened");
  EXPECT_EQ(nlohmann::json::parse(opened->data)["objectIds"], nlohmann::json({"1"}));
  EXPECT_EQ(NextData(*stream, "object")["object"]["className"], "cup");
  EXPECT_EQ(NextData(*stream, "mesh")["bytes"]["draco"], 11);
  EXPECT_OK(service_.FinishSession(id).status());
  EXPECT_EQ(NextData(*stream, "end"), (nlohmann::json{{"code", "OK"}, {"message", ""}}));
  EXPECT_FALSE(stream->NextEvent());
}

TEST_F(EventsTest, ADeletedSessionEndsItsStreams) {
  Start();
  const std::string id = NewMap({"cup"});
  const auto stream = Watch(id);
  ASSERT_NE(stream, nullptr);
  EXPECT_EQ(Send("DELETE", "/api/v1/sessions/" + id, "X-Romap: 1\r\n").code, 200);
  EXPECT_EQ(NextData(*stream, "end")["code"], "NOT_FOUND");
}

TEST_F(EventsTest, AreFilteredByClass) {
  Start();
  const std::string id = NewMap({"cup", "chair", "book"});
  const auto stream = Watch(id, "?classes=chair,sofa&meshes=0");
  ASSERT_NE(stream, nullptr);
  EXPECT_OK(service_.FinishSession(id).status());
  std::vector<std::string> kinds;
  while (const auto event = stream->NextEvent()) {
    const nlohmann::json data = nlohmann::json::parse(event->data);
    if (event->name != "map") continue;
    kinds.push_back(data.begin().key());
    if (data.contains("object")) {
      EXPECT_EQ(data["object"]["className"], "chair");
    }
  }
  EXPECT_THAT(kinds, ::testing::ElementsAre("object"));
}

TEST_F(EventsTest, ARevokedTokenEndsThem) {
  const std::string admin = tokens_.Create("b", "ops", access::Role::kAdmin).value();
  Start();
  UseToken(admin);
  const std::string id = NewMap({"cup"});
  const auto stream = Watch(id);
  ASSERT_NE(stream, nullptr);
  RevokeAll();
  EXPECT_EQ(NextData(*stream, "end")["code"], "UNAUTHENTICATED");
}

TEST_F(EventsTest, TheirNumberIsLimited) {
  options_.config.max_viewers = 2;
  Start();
  const std::string id = NewSession();
  auto first = Watch(id), second = Watch(id);
  ASSERT_TRUE(first && second);
  const HttpReply refused = Get("/api/v1/sessions/" + id + "/events");
  EXPECT_EQ(refused.code, 429);
  EXPECT_TRUE(refused.headers.contains("retry-after"));
  first.reset();
  EXPECT_TRUE(Eventually([&] { return Watch(id) != nullptr; })) << "a viewer that has gone makes room";
}

// The fake keeps all events, unlike the outbox of a session: what is not sent stays in its memory, not in ours.
TEST_F(EventsTest, AViewerThatDoesNotReadDelaysNobody) {
  Start();
  const std::string id = NewMap({"cup"});
  const auto stalled = Watch(id), reader = Watch(id, "?meshes=0");
  ASSERT_TRUE(stalled && reader);
  auto stream = service_.OpenMap(id).value();
  constexpr uint64_t kFrames = 8'000;  // more text than the buffers of the system take
  for (uint64_t frame = 2; frame <= kFrames; ++frame) EXPECT_OK(stream->Send(MakeFrame(frame, "cup")));
  while (NextData(*reader, "frameAck")["frameAck"]["frameId"] != std::to_string(kFrames)) {
  }
  EXPECT_EQ(Get("/api/v1/sessions").code, 200);
  // It gets everything when it reads again.
  while (NextData(*stalled, "frameAck")["frameAck"]["frameId"] != std::to_string(kFrames)) {
  }
}

TEST_F(EventsTest, TheServerEndsThemAtItsShutdown) {
  Start();
  const auto stream = Watch(NewSession());
  ASSERT_NE(stream, nullptr);
  server_->Shutdown();
  EXPECT_EQ(NextData(*stream, "end")["code"], "UNAVAILABLE");
}

// -------------------------------------------------------------------------------------------------------------- frames

class FramesTest : public HttpFixture {
 protected:
  HttpReply PostFrame(const std::string& session, int frame, const std::string& image = "a JPEG file") const {
    return Send("POST",
                fmt::format("/api/v1/sessions/{}/frames?frame_id={}&timestamp_ns={}", session, frame, 1000 * frame),
                "Content-Type: image/jpeg\r\n", image);
  }
};

TEST_F(FramesTest, AreAnsweredWithTheirAcknowledgment) {
  Start();
  const std::string id = NewSession();
  for (const int frame : {1, 2, 3}) {
    const HttpReply reply = PostFrame(id, frame);
    ASSERT_EQ(reply.code, 200) << reply.body;
    EXPECT_EQ(Json(reply)["frameId"], std::to_string(frame));
    EXPECT_EQ(Json(reply)["accepted"], true);
  }
  EXPECT_TRUE(service_.GetSession(id)->stream_open) << "the stream stays open for the next frame";
  EXPECT_EQ(service_.ExportMap(id)->timestamps_ns, (std::vector<int64_t>{1000, 2000, 3000}));
  EXPECT_OK(service_.FinishSession(id).status());
  EXPECT_EQ(PostFrame(id, 4).code, 409);
}

TEST_F(FramesTest, InvalidOnesAreRefused) {
  Start();
  const std::string id = NewSession();
  EXPECT_EQ(PostFrame("nothing", 1).code, 404);
  EXPECT_EQ(PostFrame(NewSession(FrameMode::kReplay), 1).code, 409) << "it would block";
  EXPECT_EQ(Send("POST", "/api/v1/sessions/" + id + "/frames?frame_id=1", "Content-Type: image/jpeg\r\n", "x").code,
            400);
  EXPECT_EQ(
      Send("POST", "/api/v1/sessions/" + id + "/frames?frame_id=-1&timestamp_ns=1", "Content-Type: image/jpeg\r\n", "x")
          .code,
      400);
  EXPECT_EQ(PostJson("/api/v1/sessions/" + id + "/frames?frame_id=1&timestamp_ns=1", "{}").code, 400);
  auto stream = service_.OpenMap(id).value();
  EXPECT_EQ(PostFrame(id, 1).code, 409) << "a client with gRPC feeds it";
}

TEST_F(FramesTest, ABusySessionRefusesMoreThanTwo) {
  std::mutex mutex;
  std::condition_variable changed;
  bool is_free = false;
  std::atomic<int> begun = 0;
  service_.SetFrameHook([&](const FrameInput&) {
    ++begun;
    std::unique_lock lock(mutex);
    changed.wait_for(lock, testing_support::kTimeout, [&] { return is_free; });
  });
  Start();
  const std::string id = NewSession();
  HttpReply first;
  std::thread client([&] { first = PostFrame(id, 1); });
  EXPECT_TRUE(Eventually([&] { return begun == 1; }));
  const HttpReply refused = PostFrame(id, 2);
  EXPECT_EQ(refused.code, 429);
  EXPECT_EQ(Json(refused)["code"], "RESOURCE_EXHAUSTED");
  {
    std::lock_guard lock(mutex);
    is_free = true;
    changed.notify_all();
  }
  client.join();
  EXPECT_EQ(first.code, 200);
  EXPECT_EQ(PostFrame(id, 3).code, 200);
}

TEST_F(FramesTest, AnotherClientCannotTakeOverTheStream) {
  const std::string owner = tokens_.Create("a", "lab", access::Role::kOwner).value();
  const std::string other = tokens_.Create("b", "lab", access::Role::kOwner).value();
  const std::string viewer = tokens_.Create("c", "lab", access::Role::kViewer).value();
  const std::string stranger = tokens_.Create("d", "office", access::Role::kOwner).value();
  Start();
  SessionOptions session{.name = "phone", .camera = testing_support::SmallCamera(), .mode = FrameMode::kLive};
  session.tenant = "lab";
  const std::string id = service_.CreateSession(session)->id;
  UseToken(viewer);
  EXPECT_EQ(PostFrame(id, 1).code, 403);
  UseToken(owner);
  EXPECT_EQ(PostFrame(id, 1).code, 200);
  UseToken(other);
  EXPECT_EQ(PostFrame(id, 2).code, 409);
  UseToken(viewer);
  EXPECT_EQ(PostFrame(id, 2).code, 403);
  UseToken(stranger);
  EXPECT_EQ(PostFrame(id, 2).code, 404);
  UseToken(owner);
  EXPECT_EQ(PostFrame(id, 2).code, 200);
  RevokeAll();
  EXPECT_EQ(PostFrame(id, 3).code, 401);
  EXPECT_TRUE(Eventually([&] { return !service_.GetSession(id)->stream_open; })) << "its stream is closed";
}

}  // namespace romap::http::events_test
