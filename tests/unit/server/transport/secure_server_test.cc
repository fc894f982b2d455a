// TLS and tokens, with a real client.

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "client/sdk/remote_mapping_service.h"
#include "common/status.h"
#include "server/access/authenticator.h"
#include "server/transport/grpc_server.h"
#include "tests/support/fake_mapping_service.h"
#include "tests/support/streams.h"
#include "tests/support/subprocess.h"
#include "tests/support/test_certificates.h"

namespace romap::transport::secure_server_test {

using absl::StatusCode;
using client::RemoteMappingService;
using client::RemoteOptions;
using ::testing::HasSubstr;
using testing_support::CertificatePair;
using testing_support::Eventually;

class SecureServerTest : public ::testing::Test {
 protected:
  SecureServerTest() {
    config_.listen_address = "127.0.0.1:0";
    options_.connect_timeout = std::chrono::milliseconds(5000);
  }
  std::string Write(const std::string& name, const std::string& text) {
    // Renamed, so that no reader sees half a file.
    std::ofstream(folder_ / (name + ".new")) << text;
    std::filesystem::rename(folder_ / (name + ".new"), folder_ / name);
    return folder_ / name;
  }
  void Use(const CertificatePair& pair) {
    config_.tls_certificate = Write("certificate.pem", pair.certificate);
    config_.tls_key = Write("key.pem", pair.key);
  }
  void UseTls() {
    Use(authority_.Issue());
    options_.tls.enabled = true;
    options_.tls.ca_file = Write("ca.pem", authority_.certificate());
  }
  void Start() {
    auto server = GrpcServer::Start(&authenticator_, config_);
    ASSERT_TRUE(server.status().ok());
    server_ = *std::move(server);
  }
  absl::Status Connect() const { return RemoteMappingService::Connect(server_->address(), options_).status(); }

  testing_support::TemporaryFolder folder_;
  testing_support::TestAuthority authority_;
  testing_support::FakeMappingService fake_;
  access::TokenStore tokens_{folder_ / "tokens.json"};
  access::Authenticator authenticator_{&fake_, folder_ / "tokens.json", {}};
  TransportConfig config_;
  RemoteOptions options_;
  std::unique_ptr<GrpcServer> server_;
};

TEST_F(SecureServerTest, ClientsThatTrustTheAuthorityConnect) {
  UseTls();
  Start();
  EXPECT_OK(Connect());
  options_.connect_timeout = std::chrono::milliseconds(500);
  options_.tls.ca_file = Write("other_ca.pem", testing_support::TestAuthority().certificate());
  EXPECT_CODE(Connect(), StatusCode::kUnavailable);  // a server of another authority
  options_.tls = {};
  EXPECT_CODE(Connect(), StatusCode::kUnavailable);
}

TEST_F(SecureServerTest, AClientNeedsACertificateIfTheServerWantsOne) {
  UseTls();
  config_.tls_client_ca = options_.tls.ca_file;
  Start();
  const CertificatePair pair = authority_.Issue();
  options_.tls.certificate = Write("client.pem", pair.certificate);
  options_.tls.key_file = Write("client_key.pem", pair.key);
  EXPECT_OK(Connect());
  const CertificatePair foreign = testing_support::TestAuthority().Issue();
  Write("client.pem", foreign.certificate);
  Write("client_key.pem", foreign.key);
  options_.connect_timeout = std::chrono::milliseconds(500);
  EXPECT_CODE(Connect(), StatusCode::kUnavailable);
  options_.tls.certificate = options_.tls.key_file = "";
  EXPECT_CODE(Connect(), StatusCode::kUnavailable);
}

TEST_F(SecureServerTest, AReplacedCertificateIsUsedAndAWrongOneIsNot) {
  UseTls();
  Start();
  const testing_support::TestAuthority next;
  const CertificatePair pair = next.Issue();
  // A certificate without its key: the server goes on with the old pair.
  Write("certificate.pem", pair.certificate);
  std::this_thread::sleep_for(std::chrono::milliseconds(2500));
  EXPECT_OK(Connect());
  Write("key.pem", pair.key);
  options_.tls.ca_file = Write("next_ca.pem", next.certificate());
  options_.connect_timeout = std::chrono::milliseconds(500);
  EXPECT_TRUE(Eventually([&] { return Connect().ok(); }));
}

TEST_F(SecureServerTest, FilesThatDoNotFitAreRefusedAtTheStart) {
  UseTls();
  const auto refused = [&] { return GrpcServer::Start(&fake_, config_).status(); };
  Write("key.pem", authority_.Issue().key);
  EXPECT_CODE(refused(), StatusCode::kInvalidArgument);
  EXPECT_THAT(Message(refused()), HasSubstr("is not the key of the certificate in"));
  Write("key.pem", "nonsense");
  EXPECT_THAT(Message(refused()), HasSubstr("key.pem: has no private key"));
  Use(authority_.Issue(/*days=*/-1));
  EXPECT_THAT(Message(refused()), HasSubstr("the certificate has expired"));
  Use(authority_.Issue());
  config_.tls_client_ca = Write("client_ca.pem", "");
  EXPECT_THAT(Message(refused()), HasSubstr("client_ca.pem: has no certificate"));
  config_.tls_client_ca = "";
  config_.tls_key = folder_ / "missing.pem";
  EXPECT_CODE(refused(), StatusCode::kNotFound);
  config_.tls_key = "";
  EXPECT_THAT(Message(refused()), HasSubstr("needs both"));
}

TEST_F(SecureServerTest, CallsNeedAValidToken) {
  const std::string token = tokens_.Create("a", "lab", access::Role::kOwner).value();
  Start();
  EXPECT_CODE(Connect(), StatusCode::kUnauthenticated);
  options_.token = token + "x";
  EXPECT_CODE(Connect(), StatusCode::kUnauthenticated);
  options_.token = token;
  auto service = RemoteMappingService::Connect(server_->address(), options_);
  ASSERT_TRUE(service.status().ok());
  const std::string id = (*service)->CreateSession({.name = "", .camera = testing_support::SmallCamera()})->id;
  EXPECT_EQ((*service)->GetSession(id)->tenant, "lab");

  // Streams of every kind, too.
  const std::string other = tokens_.Create("b", "office", access::Role::kOwner).value();
  options_.token = other;
  auto stranger = RemoteMappingService::Connect(server_->address(), options_);
  ASSERT_TRUE(stranger.status().ok());
  EXPECT_CODE((*stranger)->Watch(id).status(), StatusCode::kNotFound);
  EXPECT_CODE((*stranger)->OpenMap(id).status(), StatusCode::kNotFound);
  EXPECT_CODE((*stranger)->ExportMap(id).status(), StatusCode::kNotFound);
}

TEST_F(SecureServerTest, ARevokedTokenEndsItsStreams) {
  options_.token = tokens_.Create("a", "lab", access::Role::kOwner).value();
  Start();
  auto service = RemoteMappingService::Connect(server_->address(), options_);
  ASSERT_TRUE(service.status().ok());
  const std::string id = (*service)->CreateSession({.name = "", .camera = testing_support::SmallCamera()})->id;
  const auto stream = (*service)->OpenMap(id).value();
  EXPECT_OK(tokens_.Revoke(tokens_.List()->at(0).id));
  EXPECT_TRUE(Eventually([&] {
    stream->Next(std::chrono::milliseconds(100));
    return stream->Done();
  }));
  EXPECT_CODE(stream->status(), StatusCode::kUnauthenticated);
}

TEST_F(SecureServerTest, ATokenIsNotSentInClearTextToAnotherMachine) {
  options_.token = "romap_0_1";
  // A name may lead anywhere, whatever it begins with.
  for (const char* address : {"192.0.2.1:50051", "127.example.invalid:50051", "localhost.example.invalid:50051"}) {
    const auto refused = RemoteMappingService::Connect(address, options_);
    EXPECT_CODE(refused.status(), StatusCode::kInvalidArgument);
    EXPECT_THAT(Message(refused.status()), HasSubstr("in clear text"));
  }
}

}  // namespace romap::transport::secure_server_test
