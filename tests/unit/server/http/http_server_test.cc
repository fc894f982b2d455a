// The requests of the interface, with a fake service.

#include "server/http/http_server.h"

#include "common/status.h"
#include "tests/unit/server/http/http_fixture.h"

namespace romap::http {
std::span<const Asset> TestAssets();  // made by romap_embed_files() in CMakeLists.txt
}

namespace romap::http::http_server_test {

using absl::StatusCode;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class HttpServerTest : public HttpFixture {};

TEST_F(HttpServerTest, SessionsAreCreatedListedFinishedAndDeleted) {
  Start();
  const HttpReply created = PostJson("/api/v1/sessions", R"({"name": "kitchen", "mode": "FRAME_MODE_LIVE",
      "camera": {"widthPx": 64, "heightPx": 48, "fxPx": 60, "fyPx": 60, "cxPx": 31.5, "cyPx": 23.5}})");
  ASSERT_EQ(created.code, 200) << created.body;
  const std::string id = Json(created)["session"]["id"];
  EXPECT_EQ(Json(Get("/api/v1/sessions"))["sessions"][0]["name"], "kitchen");
  EXPECT_EQ(Json(Get("/api/v1/sessions/" + id))["mode"], "FRAME_MODE_LIVE");
  EXPECT_EQ(Json(PostJson("/api/v1/sessions/" + id + "/finish", ""))["state"], "SESSION_STATE_FINISHED");
  EXPECT_EQ(PostJson("/api/v1/sessions/" + id + "/pin", R"({"pinned": true})").code, 409) << "the fake stores nothing";
  const HttpReply deleted = Send("DELETE", "/api/v1/sessions/" + id, "X-Romap: 1\r\n");
  EXPECT_EQ(deleted.code, 200);
  EXPECT_EQ(deleted.body, "{}");
  const HttpReply missing = Get("/api/v1/sessions/" + id);
  EXPECT_EQ(missing.code, 404);
  EXPECT_EQ(Json(missing)["code"], "NOT_FOUND");
  EXPECT_THAT(Json(missing)["message"].get<std::string>(), HasSubstr("does not exist"));
}

TEST_F(HttpServerTest, EveryResponseHasTheHeadersThatProtectThePage) {
  options_.assets = TestAssets();
  Start();
  for (const char* path : {"/", "/api/v1/server", "/api/v1/sessions", "/nothing", "/metrics"}) {
    const HttpReply reply = Get(path);
    EXPECT_THAT(reply.headers.at("content-security-policy"), HasSubstr("default-src 'none'")) << path;
    EXPECT_EQ(reply.headers.at("x-content-type-options"), "nosniff") << path;
    EXPECT_EQ(reply.headers.at("referrer-policy"), "no-referrer") << path;
    EXPECT_FALSE(reply.headers.contains("set-cookie"));
    EXPECT_FALSE(reply.headers.contains("access-control-allow-origin"));
  }
}

TEST_F(HttpServerTest, InvalidRequestsGetOneClearError) {
  Start();
  EXPECT_EQ(PostJson("/api/v1/sessions", "{").code, 400);
  const HttpReply no_camera = PostJson("/api/v1/sessions", "{}");
  EXPECT_EQ(no_camera.code, 400);
  EXPECT_EQ(Json(no_camera), (nlohmann::json{{"code", "INVALID_ARGUMENT"}, {"message", "camera: missing"}}));
  EXPECT_EQ(Get("/api/v1/sessions/x/events?meshes=7").code, 400);
  EXPECT_EQ(Get("/api/v1/sessions/x/finish").code, 501);
  EXPECT_EQ(Get("/api/v1/sessions/x/events").code, 404);
  EXPECT_EQ(Send("POST", "/api/v1/sessions", "Content-Type: text/plain\r\n", "{}").code, 400);
  const std::string id = NewSession();
  EXPECT_EQ(Send("DELETE", "/api/v1/sessions/" + id).code, 400);
  EXPECT_OK(service_.GetSession(id).status());
}

TEST_F(HttpServerTest, ForeignHostNamesAreRefusedOnLoopback) {
  Start();
  const auto code = [&](const std::string& host) {
    const auto connection = HttpConnection::Open(address());
    connection->Send("GET /api/v1/sessions HTTP/1.1\r\nHost: " + host + "\r\n\r\n");
    const auto reply = connection->Read();
    return reply ? reply->code : 0;
  };
  EXPECT_EQ(code("localhost:8080"), 200);
  EXPECT_EQ(code("127.0.0.1"), 200);
  EXPECT_EQ(code("evil.example"), 403);
}

TEST_F(HttpServerTest, MeshesAreFetchedByTheRevisionOfTheirEvent) {
  Start();
  const std::string id = NewMap({"cup"});
  const auto stream = Watch(id);
  ASSERT_NE(stream, nullptr);
  const nlohmann::json announced = NextData(*stream, "mesh");
  const std::string object = announced["mesh"]["id"], revision = announced["mesh"]["revision"];
  const std::string base = "/api/v1/sessions/" + id + "/objects/" + object + "/mesh/";
  const HttpReply mesh = Get(base + revision);
  EXPECT_EQ(mesh.body, "mesh of cup");
  EXPECT_EQ(mesh.body.size(), announced["bytes"]["draco"].get<size_t>());
  EXPECT_THAT(mesh.headers.at("cache-control"), HasSubstr("immutable"));
  EXPECT_EQ(Get(base + "99").code, 404);
  EXPECT_EQ(Get(base + revision + "/texture").code, 404);
  EXPECT_EQ(Get(base + revision + "/levels/0").code, 404);
  EXPECT_EQ(Get("/api/v1/sessions/" + id + "/objects/77/mesh/1").code, 404);
}

TEST_F(HttpServerTest, AMeshThatNoViewerSawComesFromTheService) {
  Start();
  const std::string id = NewMap({"cup"});
  const uint64_t revision = service_.ExportMap(id)->objects[0].mesh->revision;
  const HttpReply mesh = Get(fmt::format("/api/v1/sessions/{}/objects/1/mesh/{}", id, revision));
  EXPECT_EQ(mesh.body, service_.ExportMap(id)->objects[0].mesh->draco);
}

TEST_F(HttpServerTest, MapsAreDownloadedAsGlb) {
  Start();
  const std::string id = NewMap({"cup", "book"});
  const HttpReply map = Get("/api/v1/sessions/" + id + "/map.glb");
  EXPECT_EQ(map.headers.at("content-type"), "model/gltf-binary");
  EXPECT_THAT(map.headers.at("content-disposition"), HasSubstr("map_" + id + ".glb"));
  ASSERT_GT(map.body.size(), 20u);
  uint32_t json_bytes = 0;
  std::memcpy(&json_bytes, map.body.data() + 12, sizeof(json_bytes));
  EXPECT_EQ(nlohmann::json::parse(map.body.substr(20, json_bytes))["meshes"].size(), 2u);
  const HttpReply object = Get("/api/v1/sessions/" + id + "/objects/1.glb");
  EXPECT_EQ(object.body.substr(0, 4), "glTF");
  EXPECT_EQ(Get("/api/v1/sessions/" + id + "/objects/7.glb").code, 404);
}

TEST_F(HttpServerTest, TrajectoryPointsAndImageAreSent) {
  Start();
  const std::string id = NewMap({"cup", "cup"});
  const nlohmann::json trajectory = Json(Get("/api/v1/sessions/" + id + "/trajectory"));
  ASSERT_EQ(trajectory.size(), 2u);
  EXPECT_EQ(trajectory[1]["frame"]["frameId"], "2");
  EXPECT_EQ(trajectory[1]["timestampNs"], "66000000");
  const HttpReply points = Get("/api/v1/sessions/" + id + "/points");
  EXPECT_EQ(points.headers.at("x-romap-revision"), "3");
  EXPECT_EQ(points.headers.at("x-romap-map-id"), "2");
  std::array<float, 6> coordinates{};
  ASSERT_EQ(points.body.size(), sizeof(coordinates));
  std::memcpy(coordinates.data(), points.body.data(), sizeof(coordinates));
  EXPECT_THAT(coordinates, ::testing::ElementsAre(1, 2, 3, 4, 5, 6));
  const HttpReply image = Get("/api/v1/sessions/" + id + "/frame.jpg");
  EXPECT_EQ(image.headers.at("content-type"), "image/jpeg");
  EXPECT_EQ(image.body, "a JPEG file");
  EXPECT_EQ(Json(Get("/api/v1/sessions/" + NewSession() + "/trajectory")), nlohmann::json::array());
}

// --------------------------------------------------------------------------------------------------------------- pages

TEST_F(HttpServerTest, TheEmbeddedFilesAreServed) {
  options_.assets = TestAssets();
  Start();
  const HttpReply page = Get("/");
  EXPECT_EQ(page.body, "<!doctype html><p>the \"page\"</p>\n");
  EXPECT_EQ(page.headers.at("content-type"), "text/html; charset=utf-8");
  EXPECT_EQ(page.headers.at("cache-control"), "no-cache");
  EXPECT_EQ(Get("/camera").body, "<!doctype html><p>camera</p>\n");
  const HttpReply script = Get("/assets/index-1a2b.js");
  EXPECT_EQ(script.body.size(), 60'000u);
  EXPECT_EQ(script.headers.at("content-type"), "text/javascript; charset=utf-8");
  EXPECT_THAT(script.headers.at("cache-control"), HasSubstr("immutable"));
  const HttpReply packed = Get("/assets/index-1a2b.js", "Accept-Encoding: br, gzip\r\n");
  EXPECT_EQ(packed.headers.at("content-encoding"), "gzip");
  EXPECT_EQ(packed.body.substr(0, 2), "\x1f\x8b");
  EXPECT_LT(packed.body.size(), 2'000u);
  EXPECT_EQ(Get("/assets/data.bin").body, "a,b;c") << "binary files are not changed";
  for (const char* path : {"/index", "/assets/", "/../server.yaml", "/assets/../../etc/passwd", "/%2e%2e/etc/passwd",
                           "//etc/passwd", "/assets/index-1a2b.js/x"}) {
    EXPECT_NE(Get(path).code, 200) << path;
  }
}

TEST_F(HttpServerTest, WithoutAPageItSaysSo) {
  Start();
  EXPECT_THAT(Get("/").body, HasSubstr("was built without its page"));
  EXPECT_EQ(Get("/index.html").code, 404);
}

// -------------------------------------------------------------------------------------------------------------- access

TEST_F(HttpServerTest, TokensAndRolesApplyAsOverGrpc) {
  const std::string owner = tokens_.Create("a", "lab", access::Role::kOwner).value();
  const std::string viewer = tokens_.Create("b", "lab", access::Role::kViewer).value();
  const std::string stranger = tokens_.Create("c", "office", access::Role::kOwner).value();
  const std::string admin = tokens_.Create("d", "ops", access::Role::kAdmin).value();
  Start();
  EXPECT_EQ(Json(Get("/api/v1/server"))["needsToken"], true);
  const HttpReply refused = Get("/api/v1/sessions");
  EXPECT_EQ(refused.code, 401);
  EXPECT_EQ(Json(refused)["code"], "UNAUTHENTICATED");
  UseToken(owner);
  const std::string id = Json(PostJson("/api/v1/sessions", R"({"camera": {"widthPx": 64, "heightPx": 48, "fxPx": 60,
      "fyPx": 60, "cxPx": 31.5, "cyPx": 23.5}})"))["session"]["id"];
  const std::string base = "/api/v1/sessions/" + id;
  {
    auto stream = service_.OpenMap(id).value();
    EXPECT_OK(stream->Send(testing_support::MakeFrame(1, "cup")));
  }
  const std::string mesh = fmt::format("{}/objects/1/mesh/{}", base, service_.ExportMap(id)->objects[0].mesh->revision);
  EXPECT_EQ(Get(mesh).code, 200);
  UseToken(viewer);
  EXPECT_EQ(Get(base).code, 200);
  EXPECT_EQ(PostJson(base + "/finish", "").code, 403);
  EXPECT_EQ(Get("/metrics").code, 403);
  UseToken(stranger);
  for (const std::string& path : {base, mesh, base + "/map.glb", base + "/objects/1.glb", base + "/trajectory",
                                  base + "/points", base + "/frame.jpg", base + "/events"}) {
    EXPECT_EQ(Get(path).code, 404) << path;
  }
  EXPECT_THAT(Json(Get("/api/v1/sessions"))["sessions"], IsEmpty());
  UseToken(admin);
  EXPECT_THAT(Get("/metrics").body, HasSubstr("romap_sessions{state=\"open\"} 1"));
}

TEST_F(HttpServerTest, TheConfigurationIsChecked) {
  options_.config.listen_address = "nowhere";
  EXPECT_CODE(HttpServer::Start(&authenticator_, options_).status(), StatusCode::kInvalidArgument);
  options_.config.listen_address = "127.0.0.1:0";
  Start();
  options_.config.listen_address = address();
  const auto second = HttpServer::Start(&authenticator_, options_);
  EXPECT_CODE(second.status(), StatusCode::kUnavailable);
  EXPECT_THAT(Message(second.status()), HasSubstr("Address already in use"));
}

}  // namespace romap::http::http_server_test
