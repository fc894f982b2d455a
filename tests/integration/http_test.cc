// The HTTP interface of the real server, with a session that maps.

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "client/files/sequence.h"
#include "client/sdk/remote_mapping_service.h"
#include "client/synth/synth.h"
#include "common/mesh_codec.h"
#include "tests/integration/quick_run.h"
#include "tests/integration/recording_client.h"
#include "tests/support/http_client.h"
#include "tests/support/subprocess.h"
#include "tests/support/test_certificates.h"
#include "tests/support/world_input.h"

namespace romap::http_test {

using ::testing::HasSubstr;
using testing_support::BackgroundProcess;
using testing_support::HttpConnection;
using testing_support::HttpReply;
using testing_support::ProcessResult;
using testing_support::RunProcess;

constexpr int kFrames = 30;

class HttpTest : public ::testing::Test {
 protected:
  void Start(std::vector<std::string> arguments = {}) {
    std::vector<std::string> command{ROMAP_SERVER,  "--listen",   "127.0.0.1:0",   "--http",
                                     "127.0.0.1:0", "--data-dir", folder_ / "data"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    server_ = std::make_unique<BackgroundProcess>(integration::WithLittleTraining(std::move(command)));
    grpc_address_ = server_->WaitForLine("romap-server listening on ");
    const std::string url = server_->WaitForLine("romap-server page at ");
    ASSERT_THAT(url, HasSubstr("://127.0.0.1:"));
    address_ = url.substr(url.find("://") + 3);
    address_.pop_back();  // the slash
  }
  HttpReply Send(const std::string& method, const std::string& target, const std::string& headers = "",
                 const std::string& body = "") const {
    return testing_support::Fetch(address_, method, target, headers + authorization_, body, tls_).value_or(HttpReply{});
  }
  HttpReply Get(const std::string& target) const { return Send("GET", target); }
  static nlohmann::json Json(const HttpReply& reply) { return nlohmann::json::parse(reply.body, nullptr, false); }
  std::unique_ptr<HttpConnection> Watch(const std::string& session) const {
    auto connection = HttpConnection::Open(address_, tls_);
    connection->Request("GET", "/api/v1/sessions/" + session + "/events", authorization_);
    const auto head = connection->ReadHead();
    EXPECT_TRUE(head && head->code == 200);
    return connection;
  }
  // Sends the frames of a small world over gRPC and finishes the session.
  void Map(MappingService& service, const std::string& session) const {
    auto stream = service.OpenMap(session);
    ASSERT_TRUE(stream.ok()) << stream.status();
    for (int i = 0; i < kFrames; ++i) EXPECT_OK((*stream)->Send(testing_support::MakeWorldInput(world_, i)));
    EXPECT_OK((*stream)->CloseSend());
    testing_support::ReadToEnd(**stream);
    EXPECT_OK(service.FinishSession(session).status());
  }

  testing_support::TemporaryFolder folder_;
  const SyntheticWorld world_{integration::SmallWorld()};
  std::unique_ptr<BackgroundProcess> server_;
  std::string grpc_address_, address_;
  std::string authorization_;
  std::optional<testing_support::HttpTls> tls_;
};

TEST_F(HttpTest, AViewerSeesAMapFromItsBeginningToItsEnd) {
  Start();
  auto service = client::RemoteMappingService::Connect(grpc_address_);
  ASSERT_TRUE(service.ok()) << service.status();
  const std::string session = (*service)->CreateSession({.name = "kitchen", .camera = world_.camera()}).value().id;
  const auto viewer = Watch(session);
  auto watched = (*service)->Watch(session).value();
  Map(**service, session);

  std::map<std::string, nlohmann::json> meshes;  // the newest event of each object
  uint64_t acks = 0;
  nlohmann::json end;
  while (const auto event = viewer->NextEvent()) {
    const nlohmann::json data = nlohmann::json::parse(event->data);
    if (event->name == "end") end = data;
    if (data.contains("mesh")) meshes[data["mesh"]["id"]] = data;
    if (data.contains("frameAck")) ++acks;
  }
  EXPECT_EQ(end["code"], "OK");
  EXPECT_GT(acks, 0u);
  ASSERT_FALSE(meshes.empty());

  // The same bytes as over gRPC, for all objects of the final map.
  std::map<uint64_t, MeshUpdate> streamed;
  for (const MeshUpdate& mesh : testing_support::Only<MeshUpdate>(testing_support::ReadToEnd(*watched))) {
    streamed[mesh.id.value] = mesh;
  }
  const MapSnapshot map = (*service)->ExportMap(session).value();
  const std::string base = "/api/v1/sessions/" + session;
  size_t with_mesh = 0;
  for (const ObjectSnapshot& object : map.objects) {
    if (!object.mesh) continue;
    ++with_mesh;
    const uint64_t id = object.object.id.value;
    const nlohmann::json& data = meshes.at(std::to_string(id));
    EXPECT_EQ(data["mesh"]["revision"], std::to_string(streamed.at(id).revision));
    const HttpReply mesh = Get(fmt::format("{}/objects/{}/mesh/{}", base, id, streamed.at(id).revision));
    EXPECT_EQ(mesh.code, 200) << mesh.body;
    EXPECT_TRUE(mesh.body == streamed.at(id).draco) << "object " << id;
    EXPECT_EQ(mesh.body.size(), data["bytes"]["draco"].get<size_t>());
    EXPECT_OK(DecodeDraco(mesh.body).status());
    EXPECT_EQ(Get(fmt::format("{}/objects/{}.glb", base, id)).body.substr(0, 4), "glTF");
  }
  EXPECT_GT(with_mesh, 0u);
  const HttpReply glb = Get(base + "/map.glb");
  uint32_t json_bytes = 0;
  ASSERT_GT(glb.body.size(), 20u);
  std::memcpy(&json_bytes, glb.body.data() + 12, sizeof(json_bytes));
  EXPECT_EQ(nlohmann::json::parse(glb.body.substr(20, json_bytes))["meshes"].size(), with_mesh);
  EXPECT_EQ(Json(Get(base + "/trajectory")).size(), map.trajectory.size());
  EXPECT_EQ(Json(Get(base))["state"], "SESSION_STATE_FINISHED");
  EXPECT_EQ(Json(Send("POST", base + "/pin", "X-Romap: 1\r\n", R"({"pinned": true})"))["pinned"], true);

  const std::string metrics = Get("/metrics").body;
  EXPECT_THAT(metrics, HasSubstr(fmt::format("romap_frames_received_total {}\n", kFrames)));
  EXPECT_THAT(metrics, HasSubstr(fmt::format("romap_tracking_latency_seconds_count {}\n", kFrames)));
  EXPECT_THAT(metrics, HasSubstr("romap_sessions{state=\"finished\"} 1\n"));
  EXPECT_EQ(Send("DELETE", base, "X-Romap: 1\r\n").code, 200);
  EXPECT_EQ(Get(base).code, 404);
  server_->Signal(SIGTERM);
  EXPECT_EQ(server_->Wait().exit_code, 0);
}

TEST_F(HttpTest, ACameraFeedsALiveSession) {
  constexpr int kImages = 60;
  synth::SynthOptions options{.seed = 3, .objects = 2, .frames = kImages, .width_px = 320, .height_px = 240};
  options.rounds = 0.3;
  ASSERT_TRUE(synth::MakeSequence(options, folder_ / "sequence").ok());
  const files::Sequence sequence = files::Sequence::Open(folder_ / "sequence", {}).value();
  const CameraModel camera = sequence.camera();
  Start();
  const nlohmann::json request = {{"name", "phone"},
                                  {"mode", "FRAME_MODE_LIVE"},
                                  {"poseUse", "POSE_USE_IGNORE"},
                                  {"camera",
                                   {{"widthPx", camera.width_px},
                                    {"heightPx", camera.height_px},
                                    {"fxPx", camera.fx_px},
                                    {"fyPx", camera.fy_px},
                                    {"cxPx", camera.cx_px},
                                    {"cyPx", camera.cy_px}}}};
  const HttpReply created = Send("POST", "/api/v1/sessions", "Content-Type: application/json\r\n", request.dump());
  ASSERT_EQ(created.code, 200) << created.body;
  const std::string base = "/api/v1/sessions/" + Json(created)["session"]["id"].get<std::string>();
  EXPECT_EQ(Get(base + "/frame.jpg").code, 404) << "there is no image yet";
  const auto post = [&](int index, const std::string& image) {
    return Send(
        "POST",
        fmt::format("{}/frames?frame_id={}&timestamp_ns={}", base, index + 1, int64_t{40'000'000} * (index + 1)),
        "Content-Type: image/jpeg\r\n", image);
  };
  const auto jpeg = [&](int index) {
    const std::string image = sequence.Load(index)->image;
    std::vector<unsigned char> bytes;
    cv::imencode(".jpg", cv::imdecode(std::vector<char>(image.begin(), image.end()), cv::IMREAD_COLOR), bytes,
                 {cv::IMWRITE_JPEG_QUALITY, 95});
    return std::string(bytes.begin(), bytes.end());
  };
  bool is_tracked = false;
  for (int i = 0; i < kImages; ++i) {
    HttpReply reply = post(i, jpeg(i));
    ASSERT_EQ(reply.code, 200) << reply.body;
    EXPECT_EQ(Json(reply)["accepted"], true) << reply.body;
    is_tracked |= Json(reply).contains("tWorldCamera");
  }
  const HttpReply damaged = post(kImages, "no image");
  EXPECT_EQ(damaged.code, 200);
  EXPECT_EQ(Json(damaged)["accepted"], false);
  const HttpReply image = Get(base + "/frame.jpg");
  EXPECT_EQ(image.headers.at("x-romap-frame-id"), std::to_string(kImages));
  const cv::Mat decoded = cv::imdecode(std::vector<char>(image.body.begin(), image.body.end()), cv::IMREAD_COLOR);
  EXPECT_EQ(decoded.size(), cv::Size(camera.width_px, camera.height_px));
  EXPECT_TRUE(is_tracked) << "the frames show a scene that can be tracked";
  EXPECT_TRUE(testing_support::Eventually([&] {
    const HttpReply points = Get(base + "/points");
    return points.body.size() >= 12 * 20 && points.body.size() % 12 == 0 && points.headers.at("x-romap-map-id") != "0";
  }));
}

TEST_F(HttpTest, TokensAndTlsProtectIt) {
  const testing_support::TestAuthority authority;
  const testing_support::CertificatePair pair = authority.Issue();
  std::ofstream(folder_ / "certificate.pem") << pair.certificate;
  std::ofstream(folder_ / "key.pem") << pair.key;
  const auto token = [&](std::vector<std::string> arguments) {
    std::vector<std::string> command{ROMAP_SERVER, "token"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    command.insert(command.end(), {"--data-dir", folder_ / "data"});
    return RunProcess(command).out;
  };
  std::string secret = token({"create", "--tenant", "lab", "--role", "owner"});
  secret.pop_back();  // the end of the line
  Start({"--tls-cert", folder_ / "certificate.pem", "--tls-key", folder_ / "key.pem"});
  EXPECT_EQ(Get("/api/v1/server").code, 0) << "no clear text";
  tls_ = {.ca = authority.certificate()};
  EXPECT_EQ(Json(Get("/api/v1/server"))["needsToken"], true);
  EXPECT_EQ(Get("/api/v1/sessions").code, 401);
  authorization_ = "Authorization: Bearer " + secret + "\r\n";
  const HttpReply created = Send("POST", "/api/v1/sessions", "Content-Type: application/json\r\n",
                                 R"({"camera": {"widthPx": 64, "heightPx": 48, "fxPx": 60, "fyPx": 60, "cxPx": 31,
                                     "cyPx": 23}})");
  ASSERT_EQ(created.code, 200) << created.body;
  EXPECT_EQ(Json(created)["session"]["tenant"], "lab");
  EXPECT_EQ(Get("/metrics").code, 403);
  const auto viewer = Watch(Json(created)["session"]["id"]);
  const std::string listed = token({"list"});
  token({"revoke", secret.substr(secret.find('_') + 1, 8)});
  EXPECT_NE(token({"list"}), listed);
  std::string code;
  while (const auto event = viewer->NextEvent()) {
    if (event->name == "end") code = nlohmann::json::parse(event->data)["code"];
  }
  EXPECT_EQ(code, "UNAUTHENTICATED");
  server_->Signal(SIGTERM);
  EXPECT_THAT(server_->Wait().err, ::testing::Not(HasSubstr(secret.substr(secret.rfind('_') + 1))));
}

TEST_F(HttpTest, TheAddressIsChecked) {
  Start();
  const auto run = [&](std::vector<std::string> arguments) {
    std::vector<std::string> command{ROMAP_SERVER, "--ephemeral", "--listen", "127.0.0.1:0"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    return RunProcess(command);
  };
  const ProcessResult used = run({"--http", address_});
  EXPECT_EQ(used.exit_code, 1);
  EXPECT_THAT(used.err, HasSubstr("cannot listen on " + address_ + ": Address already in use"));
  EXPECT_EQ(run({"--http", "nowhere"}).exit_code, 2);
  const ProcessResult open = run({"--http", "0.0.0.0:0"});
  EXPECT_EQ(open.exit_code, 2);
  EXPECT_THAT(open.err, HasSubstr("the server has no tokens"));
  EXPECT_EQ(run({"--http", "", "--check-config"}).exit_code, 0);
}

}  // namespace romap::http_test
