#pragma once

#include <gmock/gmock.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "common/mesh_codec.h"
#include "common/status.h"
#include "server/access/authenticator.h"
#include "server/access/token_store.h"
#include "server/http/http_server.h"
#include "tests/support/fake_mapping_service.h"
#include "tests/support/http_client.h"
#include "tests/support/streams.h"
#include "tests/support/subprocess.h"

namespace romap::http {

// The service of the tests: its meshes are real ones, and it has an image and points.
class ViewedService : public testing_support::FakeMappingService {
 public:
  static Mesh Triangle() {
    Mesh mesh;
    mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.triangles = {{0, 1, 2}};
    return mesh;
  }
  absl::StatusOr<MapSnapshot> ExportMap(const std::string& session_id) override {
    auto map = FakeMappingService::ExportMap(session_id);
    if (map.ok()) {
      for (ObjectSnapshot& object : map->objects) object.mesh->draco = EncodeDraco(Triangle()).value();
    }
    return map;
  }
  absl::StatusOr<SparsePoints> Points(const std::string& session_id) override {
    ROMAP_RETURN_IF_ERROR(GetSession(session_id).status());
    return SparsePoints{.revision = 3, .map_id = SparseMapId{2}, .positions_world = {{1, 2, 3}, {4, 5, 6}}};
  }
  absl::StatusOr<CameraImage> NewestImage(const std::string& session_id, int /*max_side_px*/) override {
    ROMAP_RETURN_IF_ERROR(GetSession(session_id).status());
    return CameraImage{.frame_id = 7, .jpeg = "a JPEG file"};
  }
};

// A server on a free port of loopback, and a client.
class HttpFixture : public ::testing::Test {
 protected:
  using HttpReply = testing_support::HttpReply;
  using HttpConnection = testing_support::HttpConnection;

  HttpFixture() { options_.config.listen_address = "127.0.0.1:0"; }

  void Start() {
    auto server = HttpServer::Start(&authenticator_, options_);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
  }
  const std::string& address() const { return server_->address(); }

  // A reply with code 0 if there is none.
  HttpReply Send(const std::string& method, const std::string& target, const std::string& headers = "",
                 const std::string& body = "") const {
    return testing_support::Fetch(address(), method, target, headers + authorization_, body, tls_)
        .value_or(HttpReply{});
  }
  HttpReply Get(const std::string& target, const std::string& headers = "") const {
    return Send("GET", target, headers);
  }
  HttpReply PostJson(const std::string& target, const std::string& json) const {
    return Send("POST", target, "Content-Type: application/json\r\n", json);
  }
  static nlohmann::json Json(const HttpReply& reply) {
    return nlohmann::json::parse(reply.body, nullptr, /*allow_exceptions=*/false);
  }
  // An event stream after its head was read; null if the head is no success.
  std::unique_ptr<HttpConnection> Watch(const std::string& session, const std::string& query = "") const {
    auto connection = HttpConnection::Open(address(), tls_);
    if (!connection) return nullptr;
    connection->Request("GET", "/api/v1/sessions/" + session + "/events" + query, authorization_);
    const auto head = connection->ReadHead();
    return head && head->code == 200 ? std::move(connection) : nullptr;
  }
  // The data of the next event with this name or, for "map", this kind of event.
  static nlohmann::json NextData(HttpConnection& stream, const std::string& name) {
    while (const auto event = stream.NextEvent()) {
      nlohmann::json data = nlohmann::json::parse(event->data, nullptr, false);
      if (event->name == name || (event->name == "map" && data.contains(name))) return data;
    }
    ADD_FAILURE() << "the stream ended before an event " << name;
    return {};
  }

  std::string NewSession(FrameMode mode = FrameMode::kLive) {
    SessionOptions session{.name = "kitchen", .camera = testing_support::SmallCamera(), .mode = mode};
    return service_.CreateSession(session).value().id;
  }
  // A session that has mapped one object of each class.
  std::string NewMap(const std::vector<std::string>& classes) {
    const std::string id = NewSession();
    auto stream = service_.OpenMap(id).value();
    uint64_t frame = 0;
    for (const std::string& name : classes) EXPECT_OK(stream->Send(testing_support::MakeFrame(++frame, name)));
    EXPECT_OK(stream->CloseSend());
    return id;
  }
  void RevokeAll() {
    const std::vector<access::TokenRecord> tokens = tokens_.List().value();
    for (const access::TokenRecord& token : tokens) EXPECT_OK(tokens_.Revoke(token.id));
  }
  void UseToken(const std::string& token) { authorization_ = "Authorization: Bearer " + token + "\r\n"; }

  testing_support::TemporaryFolder folder_;
  ViewedService service_;
  access::TokenStore tokens_{folder_ / "tokens.json"};
  access::Authenticator authenticator_{&service_, folder_ / "tokens.json", {}};
  HttpServer::Options options_;
  std::string authorization_;  // header line of the client
  std::optional<testing_support::HttpTls> tls_;
  std::unique_ptr<HttpServer> server_;  // uses the above
};

}  // namespace romap::http
