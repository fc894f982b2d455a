#include "server/transport/grpc_server.h"

#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/security/credentials.h>
#include <gtest/gtest.h>

#include <future>
#include <stdexcept>

#include "client/sdk/remote_mapping_service.h"
#include "common/status.h"
#include "tests/support/fake_mapping_service.h"
#include "tests/support/streams.h"

namespace romap::transport::grpc_server_test {

using absl::StatusCode;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using testing_support::Eventually;
using testing_support::FakeMappingService;
using testing_support::MakeFrame;
using testing_support::NextOf;
using testing_support::ReadToEnd;

TransportConfig AnyPort() {
  TransportConfig config;
  config.listen_address = "127.0.0.1:0";
  return config;
}

class GrpcServerTest : public ::testing::Test {
 protected:
  void Start(MappingService* service, const TransportConfig& config = AnyPort()) {
    server_ = GrpcServer::Start(service, config).value();
    client_ = client::RemoteMappingService::Connect(server_->address()).value();
  }
  std::string NewSession() {
    return client_->CreateSession({.name = "", .camera = testing_support::SmallCamera()})->id;
  }

  testing_support::FakeMappingService fake_;
  std::unique_ptr<GrpcServer> server_;
  std::unique_ptr<client::RemoteMappingService> client_;
};

TEST_F(GrpcServerTest, PortZeroSelectsAFreePort) {
  Start(&fake_);
  EXPECT_GT(server_->port(), 0);
  EXPECT_EQ(server_->address(), "127.0.0.1:" + std::to_string(server_->port()));
}

TEST_F(GrpcServerTest, SecondServerOnThePortIsUnavailable) {
  Start(&fake_);
  TransportConfig config;
  config.listen_address = server_->address();
  const auto second = GrpcServer::Start(&fake_, config);
  EXPECT_CODE(second.status(), StatusCode::kUnavailable);
  EXPECT_EQ(Message(second.status()), "cannot listen on " + server_->address() +
                                          ": the address is in use or not available (Address already in use)");
  EXPECT_OK(client_->ListSessions().status());
}

TEST_F(GrpcServerTest, MalformedAddressIsRejected) {
  for (const char* address : {"", "nonsense", "host:", ":50051", "127.0.0.1:70000", "127.0.0.1:-1", "127.0.0.1:80x"}) {
    TransportConfig config;
    config.listen_address = address;
    const auto server = GrpcServer::Start(&fake_, config);
    EXPECT_CODE(server.status(), StatusCode::kInvalidArgument);
    EXPECT_THAT(Message(server.status()), HasSubstr("must be HOST:PORT"));
  }
}

// Calls a method without generated code; request and response are serialized protobuf messages.
std::string CallRaw(const std::string& address, const std::string& method, const std::string& request) {
  grpc::GenericStub stub(grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
  grpc::ClientContext context;
  const grpc::Slice slice(request);
  const grpc::ByteBuffer sent(&slice, 1);
  grpc::ByteBuffer got;
  std::promise<grpc::Status> done;
  stub.UnaryCall(&context, method, {}, &sent, &got, [&](grpc::Status status) { done.set_value(std::move(status)); });
  const grpc::Status status = done.get_future().get();
  EXPECT_TRUE(status.ok()) << status.error_message();
  grpc::Slice answer;
  if (!status.ok() || !got.DumpToSingleSlice(&answer).ok()) return "";
  return {reinterpret_cast<const char*>(answer.begin()), answer.size()};
}

TEST_F(GrpcServerTest, HealthServiceReportsServing) {
  Start(&fake_);
  // HealthCheckRequest{service = 1: string}, HealthCheckResponse{status = 1: SERVING = 1}.
  const std::string name = "romap.v1.Mapping";
  const std::string request = "\x0a" + std::string(1, static_cast<char>(name.size())) + name;
  EXPECT_EQ(CallRaw(server_->address(), "/grpc.health.v1.Health/Check", request), "\x08\x01");
  EXPECT_EQ(CallRaw(server_->address(), "/grpc.health.v1.Health/Check", ""), "\x08\x01");
}

TEST_F(GrpcServerTest, ReflectionListsTheService) {
  Start(&fake_);
  // ServerReflectionRequest{list_services = 7: "*"}.
  EXPECT_THAT(
      CallRaw(server_->address(), "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", "\x3a\x01*"),
      HasSubstr("romap.v1.Mapping"));
}

TEST_F(GrpcServerTest, BusyServiceAppliesBackPressure) {
  constexpr uint64_t kFrames = 128;
  constexpr size_t kFrameBytes = 1 << 20;
  std::atomic<uint64_t> sent = 0;
  uint64_t accepted = 0, most_in_flight = 0;
  fake_.SetFrameHook([&](const FrameInput&) {
    most_in_flight = std::max(most_in_flight, sent - accepted);
    ++accepted;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  });
  Start(&fake_);
  const auto stream = client_->OpenMap(NewSession()).value();
  for (uint64_t id = 1; id <= kFrames; ++id) {
    FrameInput frame = testing_support::MakeFrame(id);
    frame.image.assign(kFrameBytes, '\0');
    ++sent;
    ASSERT_TRUE(stream->Send(std::move(frame)).ok());
  }
  EXPECT_OK(stream->CloseSend());
  testing_support::ReadToEnd(*stream);
  EXPECT_EQ(accepted, kFrames);
  // At most what the HTTP/2 windows and socket buffers hold.
  EXPECT_LT(most_in_flight, kFrames / 2);
}

TEST_F(GrpcServerTest, ShutdownEndsStreamsAndKeepsAcceptedFrames) {
  Start(&fake_);
  const std::string session = NewSession();
  const auto stream = client_->OpenMap(session).value();
  const auto watch = client_->Watch(session).value();
  EXPECT_OK(stream->Send(testing_support::MakeFrame(1)));
  EXPECT_TRUE(testing_support::NextOf<FrameAck>(*stream).has_value());
  server_->Shutdown();
  testing_support::ReadToEnd(*stream);
  testing_support::ReadToEnd(*watch);
  EXPECT_CODE(stream->status(), StatusCode::kUnavailable);
  EXPECT_CODE(watch->status(), StatusCode::kUnavailable);
  EXPECT_THAT(Message(watch->status()), HasSubstr("shutting down"));
  EXPECT_CODE(stream->Send(testing_support::MakeFrame(2)), StatusCode::kUnavailable);
  EXPECT_FALSE(fake_.GetSession(session)->stream_open);
  EXPECT_THAT(fake_.ExportMap(session)->trajectory, SizeIs(1));
}

TEST_F(GrpcServerTest, ShutdownWaitsForAFrameInProgress) {
  std::promise<void> in_progress, release;
  fake_.SetFrameHook([&](const FrameInput&) {
    in_progress.set_value();
    release.get_future().wait();
  });
  Start(&fake_);
  const std::string session = NewSession();
  const auto stream = client_->OpenMap(session).value();
  EXPECT_OK(stream->Send(testing_support::MakeFrame(1)));
  in_progress.get_future().wait();
  std::thread shutdown([&] { server_->Shutdown(); });
  release.set_value();
  shutdown.join();
  EXPECT_THAT(fake_.ExportMap(session)->trajectory, SizeIs(1));
}

TEST_F(GrpcServerTest, SecondShutdownHasNoEffect) {
  Start(&fake_);
  server_->Shutdown();
  server_->Shutdown();
  EXPECT_CODE(client_->ListSessions().status(), StatusCode::kUnavailable);
}

TEST_F(GrpcServerTest, DisconnectFreesTheSession) {
  Start(&fake_);
  const std::string session = NewSession();
  auto other = client::RemoteMappingService::Connect(server_->address()).value();
  auto stream = other->OpenMap(session).value();
  EXPECT_TRUE(fake_.GetSession(session)->stream_open);
  stream.reset();
  other.reset();
  EXPECT_TRUE(testing_support::Eventually([&] { return !fake_.GetSession(session)->stream_open; }));
  EXPECT_EQ(fake_.GetSession(session)->state, SessionState::kOpen);
}

TEST_F(GrpcServerTest, CallsAboveTheLimitAreRejectedUntilOneEnds) {
  TransportConfig config = AnyPort();
  config.max_calls = 2;
  Start(&fake_, config);
  const std::string session = NewSession();
  // The thread of CreateSession may still count as a call for a moment.
  absl::StatusOr<std::unique_ptr<EventStream>> first = absl::UnknownError("not called");
  ASSERT_TRUE(testing_support::Eventually([&] { return (first = client_->Watch(session)).ok(); }));
  const auto second = client_->Watch(session).value();
  EXPECT_CODE(client_->ListSessions().status(), StatusCode::kResourceExhausted);
  EXPECT_CODE(client_->Watch(session).status(), StatusCode::kResourceExhausted);
  second->Cancel();
  EXPECT_TRUE(testing_support::Eventually([&] { return client_->ListSessions().ok(); }));
}

class ThrowingService : public testing_support::FakeMappingService {
 public:
  absl::StatusOr<SessionInfo> GetSession(const std::string&) override { throw std::runtime_error("broken invariant"); }
  absl::StatusOr<std::unique_ptr<EventStream>> Watch(const std::string&) override {
    throw std::runtime_error("broken invariant");
  }
};

TEST_F(GrpcServerTest, ExceptionEndsOnlyItsCall) {
  ThrowingService service;
  Start(&service);
  EXPECT_CODE(client_->GetSession("any").status(), StatusCode::kInternal);
  EXPECT_CODE(client_->Watch("any").status(), StatusCode::kInternal);
  EXPECT_OK(client_->ListSessions().status());
  server_->Shutdown();
}

}  // namespace romap::transport::grpc_server_test
