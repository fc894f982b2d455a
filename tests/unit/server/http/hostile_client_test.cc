// Clients that no browser is, and TLS.

#include <filesystem>
#include <fstream>

#include "tests/support/test_certificates.h"
#include "tests/unit/server/http/http_fixture.h"

namespace romap::http::hostile_client_test {

using testing_support::CertificatePair;
using testing_support::Eventually;
using testing_support::TestAuthority;

class HostileClientTest : public HttpFixture {
 protected:
  std::vector<std::unique_ptr<HttpConnection>> Open(int count) const {
    std::vector<std::unique_ptr<HttpConnection>> connections;
    for (int i = 0; i < count; ++i) connections.push_back(HttpConnection::Open(address()));
    return connections;
  }
  // The server still works.
  void ExpectService() {
    EXPECT_TRUE(Eventually([&] { return Get("/api/v1/server").code == 200; }));
  }
};

TEST_F(HostileClientTest, HalfRequestsAreClosed) {
  options_.config.request_timeout_s = 0.5;
  Start();
  const auto silent = Open(100), slow = Open(100);
  for (const auto& connection : slow) connection->Send("GET /api/v1/sessions HTTP/1.1\r\nHost: loc");
  ExpectService();
  for (const auto& connection : silent) EXPECT_TRUE(connection->IsClosedByServer());
  for (const auto& connection : slow) EXPECT_TRUE(connection->IsClosedByServer());
}

// A time limit between two bytes would not end it.
TEST_F(HostileClientTest, ASlowHeaderIsClosed) {
  options_.config.request_timeout_s = 0.5;
  Start();
  const auto connection = HttpConnection::Open(address());
  ASSERT_TRUE(connection->Send("GET / HTTP/1.1\r\n"));
  EXPECT_TRUE(Eventually([&] { return !connection->Send("X: y\r\n"); }));
}

TEST_F(HostileClientTest, TooManyConnectionsAreRefused) {
  options_.config.max_connections = options_.config.max_connections_per_peer = 20;
  Start();
  auto connections = Open(60);
  int closed = 0;
  for (int i = 20; i < 60; ++i) closed += connections[i]->IsClosedByServer() ? 1 : 0;
  EXPECT_EQ(closed, 40);
  EXPECT_TRUE(connections[0]->Request("GET", "/api/v1/server"));
  EXPECT_TRUE(connections[0]->Read()) << "the earlier ones go on";
  connections.clear();
  ExpectService();
}

TEST_F(HostileClientTest, LargeRequestsAreRefused) {
  options_.config.max_body_bytes = 1 << 16;
  Start();
  EXPECT_EQ(Send("POST", "/api/v1/sessions", "Content-Type: application/json\r\n", std::string(70'000, ' ')).code, 413);
  EXPECT_EQ(Get("/api/v1/sessions", "X-Long: " + std::string(20'000, 'x') + "\r\n").code, 400);
  const auto announced = HttpConnection::Open(address());
  announced->Send("POST /api/v1/sessions HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\n\r\n");
  EXPECT_TRUE(announced->IsClosedByServer());
  const auto chunked = HttpConnection::Open(address());
  chunked->Send("POST /api/v1/sessions HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n");
  const std::string chunk = "4000\r\n" + std::string(0x4000, 'x') + "\r\n";
  EXPECT_TRUE(Eventually([&] { return !chunked->Send(chunk); }));
  const auto huge = HttpConnection::Open(address());
  huge->Send("POST /api/v1/sessions HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nffffffffffff\r\n");
  EXPECT_TRUE(huge->IsClosedByServer());
  ExpectService();
}

TEST_F(HostileClientTest, GarbageEndsOnlyItsConnection) {
  Start();
  for (const std::string& text :
       {std::string("\0\0\0\0\r\n\r\n", 8), std::string("GET\r\n\r\n"), std::string("GET / HTTP/9.9\r\n\r\n"),
        std::string("BREW / HTTP/1.1\r\nHost: localhost\r\n\r\n"),
        std::string("PUT / HTTP/1.1\r\nHost: localhost\r\n\r\n"),
        std::string("POST /api/v1/sessions HTTP/1.1\r\nHost: localhost\r\nContent-Length: -5\r\n\r\n"),
        std::string("GET * HTTP/1.1\r\nHost: localhost\r\n\r\n"),
        std::string("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", 11) + "\r\n\r\n",
        std::string("GET http://localhost/%zz HTTP/1.1\r\nHost: localhost\r\n\r\n"),
        "GET /" + std::string(50'000, 'a') + " HTTP/1.1\r\n\r\n"}) {
    const auto connection = HttpConnection::Open(address());
    ASSERT_NE(connection, nullptr);
    connection->Send(text);
    const auto reply = connection->Read();
    if (reply) {
      EXPECT_GE(reply->code, 400) << text;
    }
  }
  ExpectService();
}

// evhttp would exit if it read something that it does not expect.
TEST_F(HostileClientTest, ARequestDuringAStreamIsNoHarm) {
  Start();
  const auto stream = Watch(NewSession());
  ASSERT_NE(stream, nullptr);
  for (int i = 0; i < 10; ++i) stream->Send("GET /api/v1/sessions HTTP/1.1\r\nHost: localhost\r\n\r\n");
  ExpectService();
  EXPECT_TRUE(Eventually([&] { return !stream->Send(std::string(1 << 16, 'x')); })) << "a flood ends it";
  ExpectService();
}

TEST_F(HostileClientTest, AConnectionMayBreakAtAnyTime) {
  Start();
  const std::string id = NewMap({"cup"});
  for (const std::string& path : {std::string("/api/v1/sessions"), "/api/v1/sessions/" + id + "/map.glb",
                                  "/api/v1/sessions/" + id + "/events", std::string("/metrics")}) {
    for (int i = 0; i < 20; ++i) HttpConnection::Open(address())->Request("GET", path);
  }
  ExpectService();
}

TEST_F(HostileClientTest, KeptConnectionsServeSeveralRequests) {
  Start();
  const auto connection = HttpConnection::Open(address());
  for (int i = 0; i < 50; ++i) {
    connection->Request("GET", "/api/v1/sessions");
    const auto reply = connection->Read();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->code, 200);
  }
}

TEST_F(HostileClientTest, AClientThatReadsNoDownloadIsClosed) {
  options_.config.response_timeout_s = 0.5;
  static const std::string kLarge(64 << 20, 'x');
  static const Asset kAsset[] = {
      {.path = "large.bin", .content_type = "application/octet-stream", .data = kLarge, .gzip = {}}};
  options_.assets = kAsset;
  Start();
  const auto connection = HttpConnection::Open(address());
  connection->Request("GET", "/large.bin");
  const auto head = connection->ReadHead();
  ASSERT_TRUE(head);
  EXPECT_TRUE(Eventually([&] { return !connection->Send("x"); }));
  ExpectService();
}

// ----------------------------------------------------------------------------------------------------------------- TLS

class HttpTlsTest : public HttpFixture {
 protected:
  std::string Write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / (name + ".new")) << text;
    std::filesystem::rename(folder_ / (name + ".new"), folder_ / name);
    return folder_ / name;
  }
  void Use(const CertificatePair& pair) {
    options_.tls.tls_certificate = Write("certificate.pem", pair.certificate);
    options_.tls.tls_key = Write("key.pem", pair.key);
  }

  TestAuthority authority_;
};

TEST_F(HttpTlsTest, ServesWithTheCertificateOfTheServer) {
  Use(authority_.Issue());
  Start();
  EXPECT_EQ(server_->url().substr(0, 8), "https://");
  EXPECT_EQ(Get("/api/v1/server").code, 0) << "no clear text";
  tls_ = {.ca = authority_.certificate()};
  EXPECT_EQ(Get("/api/v1/server").code, 200);
  const std::string id = NewMap({"cup"});
  const auto stream = Watch(id);
  ASSERT_NE(stream, nullptr);
  EXPECT_EQ(NextData(*stream, "object")["object"]["className"], "cup");
  tls_ = {.ca = TestAuthority().certificate()};
  EXPECT_EQ(Get("/api/v1/server").code, 0) << "another authority";
}

TEST_F(HttpTlsTest, ANewCertificateIsUsed) {
  Use(authority_.Issue());
  Start();
  const TestAuthority next;
  Use(next.Issue());
  tls_ = {.ca = next.certificate()};
  EXPECT_TRUE(Eventually([&] { return Get("/api/v1/server").code == 200; }));
}

TEST_F(HttpTlsTest, ClientsNeedACertificateIfTheServerWantsOne) {
  Use(authority_.Issue());
  options_.tls.tls_client_ca = Write("clients.pem", authority_.certificate());
  Start();
  tls_ = {.ca = authority_.certificate()};
  EXPECT_EQ(Get("/api/v1/server").code, 0);
  const CertificatePair foreign = TestAuthority().Issue();
  tls_ = {.ca = authority_.certificate(), .certificate = foreign.certificate, .key = foreign.key};
  EXPECT_EQ(Get("/api/v1/server").code, 0);
  const CertificatePair own = authority_.Issue();
  tls_ = {.ca = authority_.certificate(), .certificate = own.certificate, .key = own.key};
  EXPECT_EQ(Get("/api/v1/server").code, 200);
}

TEST_F(HttpTlsTest, HalfHandshakesAreClosed) {
  Use(authority_.Issue());
  options_.config.request_timeout_s = 0.5;
  Start();
  std::vector<std::unique_ptr<HttpConnection>> connections;
  for (int i = 0; i < 50; ++i) connections.push_back(HttpConnection::Open(address()));
  for (const auto& connection : connections) {
    connection->Send("\x16\x03\x01");
    EXPECT_TRUE(connection->IsClosedByServer());
  }
}

}  // namespace romap::http::hostile_client_test
