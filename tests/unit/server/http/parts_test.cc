// The parts of the HTTP server that need no connection.

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "common/status.h"
#include "romap/v1/mapping.pb.h"
#include "server/http/class_filter.h"
#include "server/http/json.h"
#include "server/http/mesh_cache.h"
#include "server/http/metrics.h"
#include "server/http/request_check.h"
#include "server/http/route.h"
#include "server/http/viewers.h"
#include "tests/support/streams.h"

namespace romap::http::parts_test {

using absl::StatusCode;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

// ------------------------------------------------------------------------------------------------------------- routes

TEST(RouteTest, FindsTheResourcesOfTheInterface) {
  const auto resource = [](Method method, std::string_view path) { return ParseRoute(method, path).value().resource; };
  EXPECT_EQ(resource(Method::kGet, "/api/v1/server"), Resource::kServer);
  EXPECT_EQ(resource(Method::kPost, "/api/v1/sessions"), Resource::kSessions);
  EXPECT_EQ(resource(Method::kDelete, "/api/v1/sessions/12ab"), Resource::kSession);
  EXPECT_EQ(resource(Method::kPost, "/api/v1/sessions/12ab/finish"), Resource::kFinish);
  EXPECT_EQ(resource(Method::kGet, "/api/v1/sessions/12ab/map.glb"), Resource::kMapGlb);
  const Route route = ParseRoute(Method::kGet, "/api/v1/sessions/12ab/objects/3/mesh/45/levels/1").value();
  EXPECT_EQ(route.resource, Resource::kMeshLevel);
  EXPECT_EQ(route.session_id, "12ab");
  EXPECT_EQ(route.object, 3u);
  EXPECT_EQ(route.revision, 45u);
  EXPECT_EQ(route.level, 1u);
  EXPECT_EQ(ParseRoute(Method::kGet, "/api/v1/sessions/a/objects/9.glb").value().object, 9u);
}

TEST(RouteTest, RefusesAllOthers) {
  for (const char* path : {"/api/v1/", "/api/v1/session", "/api/v2/sessions", "/api/v1/sessions/",
                           "/api/v1/sessions/a/", "/api/v1/sessions//pin", "/api/v1/sessions/a%2fb",
                           "/api/v1/sessions/../sessions", "/api/v1/sessions/a/objects/-1.glb",
                           "/api/v1/sessions/a/objects/99999999999999999999.glb", "/api/v1/sessions/a/objects/1/mesh",
                           "/api/v1/sessions/a/objects/1/mesh/2/levels", "/api/v1/sessions/a/objects/1/mesh/2/levels/x",
                           "/api/v1/sessions/a/objects/.glb", "/api/v1/sessions/a/points/1"}) {
    SCOPED_TRACE(path);
    EXPECT_CODE(ParseRoute(Method::kGet, path).status(), StatusCode::kNotFound);
  }
  EXPECT_CODE(ParseRoute(Method::kGet, "/api/v1/sessions/a/finish").status(), StatusCode::kUnimplemented);
  EXPECT_CODE(ParseRoute(Method::kPost, "/api/v1/sessions/a/points").status(), StatusCode::kUnimplemented);
}

// --------------------------------------------------------------------------------------------------- foreign web pages

TEST(RequestCheckTest, OnlyNumbersAndLocalhostAreLocal) {
  for (const char* host : {"localhost", "localhost:8080", "127.0.0.1:8080", "10.1.2.3", "[::1]:8080", "[::1]"}) {
    EXPECT_TRUE(IsLocalOrNumber(host)) << host;
  }
  for (const char* host : {"", "romap.example", "127.0.0.1.example:80", "localhost.example", "localhost:80:80",
                           "localhost:x", "127.0.0.1:", "[::1", "[x]:80", "[::1]x", "1.2.3.4@evil"}) {
    if (std::string_view(host) == "127.0.0.1:") continue;  // an empty port is allowed (RFC 3986)
    EXPECT_FALSE(IsLocalOrNumber(host)) << host;
  }
}

TEST(RequestCheckTest, ChangesNeedWhatAFormCannotSend) {
  HttpRequest request{.method = Method::kPost, .path = "/api/v1/sessions/a/finish", .host = "localhost"};
  for (const char* type :
       {"", "text/plain", "application/x-www-form-urlencoded", "multipart/form-data", "image/jpeg"}) {
    request.content_type = type;
    SCOPED_TRACE(type);
    EXPECT_CODE(CheckRequest(request, true), StatusCode::kInvalidArgument);
  }
  request.content_type = "application/json";
  EXPECT_OK(CheckRequest(request, true));
  request.content_type = "";
  request.has_romap_header = true;
  EXPECT_OK(CheckRequest(request, true));
  request = {.method = Method::kPost, .path = "/api/v1/sessions/a/frames", .host = "romap.example"};
  request.content_type = "image/jpeg";
  SCOPED_TRACE("a server that others reach has a name");
  EXPECT_OK(CheckRequest(request, false));
  EXPECT_CODE(CheckRequest(request, true), StatusCode::kPermissionDenied);
}

// -------------------------------------------------------------------------------------------------------------- events

MeshUpdate MeshOf(uint64_t id, uint64_t revision, size_t bytes = 10) {
  MeshUpdate mesh;
  mesh.id = ObjectId{id};
  mesh.revision = revision;
  mesh.draco = std::string(bytes, 'd');
  return mesh;
}

TEST(EventJsonTest, AMeshHasTheNumbersOfItsBytesInsteadOfThem) {
  MeshUpdate mesh = MeshOf(3, 12);
  mesh.texture = {.image = "texture", .media_type = "image/jpeg"};
  mesh.levels = {{.draco = "four", .triangle_count = 7, .error_mu = 0.5}, {.draco = "x", .triangle_count = 1}};
  mesh.final = true;
  const nlohmann::json json = nlohmann::json::parse(EventJson(mesh));
  EXPECT_EQ(json["mesh"]["id"], "3");
  EXPECT_EQ(json["mesh"]["revision"], "12");
  EXPECT_EQ(json["mesh"]["draco"], "");
  EXPECT_EQ(json["mesh"]["texture"], "");
  EXPECT_EQ(json["mesh"]["textureMediaType"], "image/jpeg");
  EXPECT_EQ(json["mesh"]["levels"][0]["triangleCount"], 7);
  EXPECT_EQ(json["mesh"]["isFinal"], true);
  EXPECT_EQ(json["bytes"], nlohmann::json({{"draco", 10}, {"texture", 7}, {"levels", {4, 1}}}));
}

TEST(EventJsonTest, TheResumeTokenStaysSecret) {
  StreamOpening opening{.resume_token = "secret", .durable = true, .objects = {ObjectId{4}}, .newest_frame_id = 9};
  const std::string json = OpenedJson("12ab", opening);
  EXPECT_THAT(json, Not(HasSubstr("secret")));
  EXPECT_EQ(nlohmann::json::parse(json)["objectIds"], nlohmann::json({"4"}));
}

ObjectUpdate UpdateOf(uint64_t id, const std::string& class_name) {
  ObjectUpdate update;
  update.id = ObjectId{id};
  update.class_name = class_name;
  return update;
}

TEST(ClassFilterTest, ShowsTheObjectsOfItsClasses) {
  ClassFilter filter(ParseClasses("cup,book,,"));
  EXPECT_EQ(filter.Apply(UpdateOf(1, "cup")).joined, ObjectId{1});
  EXPECT_FALSE(filter.Apply(UpdateOf(1, "cup")).joined) << "it is known";
  EXPECT_THAT(filter.Apply(UpdateOf(2, "chair")).events, SizeIs(0));
  EXPECT_THAT(filter.Apply(MeshOf(2, 1)).events, SizeIs(0));
  EXPECT_THAT(filter.Apply(MeshOf(1, 1)).events, SizeIs(1));
  EXPECT_THAT(filter.Apply(Statistics{}).events, SizeIs(1));
  EXPECT_THAT(filter.Apply(ObjectRemoved{.id = ObjectId{2}, .revision = 1, .reason = ""}).events, SizeIs(0));
  EXPECT_EQ(filter.Apply(UpdateOf(2, "book")).joined, ObjectId{2}) << "its class has changed";
  const auto left = filter.Apply(UpdateOf(1, "chair"));
  EXPECT_EQ(std::get<ObjectRemoved>(left.events.at(0)).id, ObjectId{1});
  EXPECT_THAT(filter.Apply(MeshOf(1, 2)).events, SizeIs(0));
}

TEST(ClassFilterTest, AMergeIntoAHiddenObjectIsARemoval) {
  ClassFilter filter({"cup"});
  for (const uint64_t id : {1, 2, 3}) filter.Apply(UpdateOf(id, "cup"));
  const auto shown = filter.Apply(ObjectMerged{.from = ObjectId{1}, .into = ObjectId{2}});
  EXPECT_TRUE(std::holds_alternative<ObjectMerged>(shown.events.at(0)));
  const auto hidden = filter.Apply(ObjectMerged{.from = ObjectId{3}, .into = ObjectId{9}});
  EXPECT_EQ(std::get<ObjectRemoved>(hidden.events.at(0)).id, ObjectId{3});
  EXPECT_THAT(filter.Apply(ObjectMerged{.from = ObjectId{8}, .into = ObjectId{2}}).events, SizeIs(0));
}

TEST(ViewerOptionsTest, AreReadFromTheQuery) {
  const ViewerOptions options =
      ParseViewerOptions("a", {{"meshes", "0"}, {"classes", "cup,book"}, {"max_bytes_per_s", "50000"}}).value();
  EXPECT_FALSE(options.meshes);
  EXPECT_EQ(options.classes, (std::set<std::string>{"book", "cup"}));
  EXPECT_EQ(options.max_bytes_per_s, 50000);
  EXPECT_TRUE(ParseViewerOptions("a", {}).value().meshes);
  for (const char* rate : {"", "x", "-1", "0", "nan", "1e400", "50000k"}) {
    SCOPED_TRACE(rate);
    EXPECT_CODE(ParseViewerOptions("a", {{"max_bytes_per_s", rate}}).status(), StatusCode::kInvalidArgument);
  }
  EXPECT_CODE(ParseViewerOptions("a", {{"meshes", "yes"}}).status(), StatusCode::kInvalidArgument);
}

TEST(MeshCacheTest, KeepsTheNewestMeshOfAnObject) {
  MeshCache cache(1 << 20);
  cache.Put("a", MeshOf(1, 5));
  cache.Put("a", MeshOf(1, 4));
  EXPECT_EQ(cache.Find("a", ObjectId{1})->revision, 5u);
  EXPECT_EQ(cache.Find("b", ObjectId{1}), nullptr) << "of another session";
  cache.Put("b", MeshOf(1, 1));
  cache.RemoveSession("a");
  EXPECT_EQ(cache.Find("a", ObjectId{1}), nullptr);
  EXPECT_NE(cache.Find("b", ObjectId{1}), nullptr);
}

TEST(MeshCacheTest, ForgetsWhatWasNotUsedForTheLongestTime) {
  MeshCache cache(25'000);
  cache.Put("a", MeshOf(1, 1, 10'000));
  cache.Put("a", MeshOf(2, 1, 10'000));
  EXPECT_NE(cache.Find("a", ObjectId{1}), nullptr);
  cache.Put("a", MeshOf(3, 1, 10'000));
  EXPECT_EQ(cache.Find("a", ObjectId{2}), nullptr);
  EXPECT_NE(cache.Find("a", ObjectId{1}), nullptr);
  EXPECT_LE(cache.bytes(), 25'000u);
  EXPECT_EQ(cache.Put("a", MeshOf(4, 1, 50'000))->draco.size(), 50'000u) << "too large to keep, but returned";
  EXPECT_EQ(cache.bytes(), 0u);
}

TEST(JsonTest, WrongInputIsNamed) {
  v1::CreateSessionRequest request;
  EXPECT_OK(FromJson(R"({"name": "a", "camera": {"widthPx": 640}, "mode": "FRAME_MODE_LIVE"})", &request));
  EXPECT_EQ(request.camera().width_px(), 640u);
  for (const char* json : {"", "{", "[]", R"({"nme": "a"})", R"({"name": 3})", R"({"mode": "FAST"})"}) {
    SCOPED_TRACE(json);
    EXPECT_CODE(FromJson(json, &request), StatusCode::kInvalidArgument);
  }
  const std::string deep = std::string(50'000, '[');
  EXPECT_CODE(FromJson(R"({"name": )" + deep, &request), StatusCode::kInvalidArgument);
  EXPECT_CODE(FromJson(std::string(1 << 20, ' '), &request), StatusCode::kInvalidArgument);
}

// ------------------------------------------------------------------------------------------------------------- metrics

TEST(MetricsTest, AreWrittenForPrometheus) {
  ServiceMetrics service{.frames_received = 12, .frames_dropped = 3};
  service.tracking_latency.counts[1] = 4;
  service.tracking_latency.counts.back() = 1;
  service.tracking_latency.sum_s = 6.5;
  Metrics metrics({.service = [&] { return service; }, .grpc_connections = [] { return 2; }});
  metrics.CountResponse(200);
  metrics.CountResponse(200);
  metrics.CountResponse(404);
  metrics.SetGauges({.viewers = 5});
  SessionInfo open, finished;
  open.id = "12ab";
  open.name = "kitchen";
  open.stream_open = true;
  open.stored_bytes = 1000;
  open.statistics.frames_received = 10;
  open.statistics.frames_processed = 7;
  finished.id = "34cd";
  finished.state = SessionState::kFinished;
  finished.stored_bytes = 500;
  const std::string text = metrics.Text({open, finished});
  for (const char* line : {
           "romap_frames_received_total 12",
           "romap_frames_dropped_total 3",
           "romap_tracking_latency_seconds_bucket{le=\"0.005\"} 0",
           "romap_tracking_latency_seconds_bucket{le=\"0.01\"} 4",
           "romap_tracking_latency_seconds_bucket{le=\"+Inf\"} 5",
           "romap_tracking_latency_seconds_sum 6.5",
           "romap_tracking_latency_seconds_count 5",
           "romap_sessions{state=\"open\"} 1",
           "romap_sessions{state=\"finished\"} 1",
           "romap_sessions{state=\"failed\"} 0",
           "romap_session_frames_waiting{session=\"12ab\"} 3",
           "romap_store_bytes 1500",
           "romap_http_responses_total{code=\"200\"} 2",
           "romap_http_responses_total{code=\"404\"} 1",
           "romap_http_viewers 5",
           "romap_grpc_connections 2",
           "# TYPE romap_tracking_latency_seconds histogram",
       }) {
    EXPECT_THAT(text, HasSubstr(std::string(line) + "\n"));
  }
  EXPECT_THAT(text, Not(HasSubstr("34cd"))) << "a finished session has no series of its own";
  EXPECT_THAT(text, Not(HasSubstr("kitchen")));
}

}  // namespace romap::http::parts_test
