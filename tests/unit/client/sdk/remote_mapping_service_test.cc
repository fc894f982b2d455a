#include "client/sdk/remote_mapping_service.h"

#include <gmock/gmock.h>
#include <grpcpp/generic/async_generic_service.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include <thread>

#include "common/status.h"
#include "common/wire/events.h"
#include "romap/v1/mapping.grpc.pb.h"
#include "server/transport/grpc_server.h"
#include "tests/support/fake_mapping_service.h"
#include "tests/support/streams.h"

namespace romap::client::remote_mapping_service_test {

using absl::StatusCode;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using testing_support::Eventually;
using testing_support::MakeFrame;
using testing_support::NextOf;
using testing_support::Only;
using testing_support::ReadToEnd;

std::unique_ptr<transport::GrpcServer> StartServer(MappingService* service,
                                                   const std::string& address = "127.0.0.1:0") {
  transport::TransportConfig config;
  config.listen_address = address;
  return transport::GrpcServer::Start(service, config).value();
}

class RemoteMappingServiceTest : public ::testing::Test {
 protected:
  std::string NewSession() {
    return client_->CreateSession({.name = "", .camera = testing_support::SmallCamera()})->id;
  }

  testing_support::FakeMappingService fake_;
  std::unique_ptr<transport::GrpcServer> server_ = StartServer(&fake_);
  std::unique_ptr<RemoteMappingService> client_ = RemoteMappingService::Connect(server_->address()).value();
};

TEST_F(RemoteMappingServiceTest, ConnectWithoutServerReportsHowToStartIt) {
  const std::string address = server_->address();
  server_->Shutdown();
  const auto client = RemoteMappingService::Connect(address, {.connect_timeout = std::chrono::milliseconds(200)});
  EXPECT_CODE(client.status(), StatusCode::kUnavailable);
  EXPECT_EQ(Message(client.status()), "cannot connect to romap-server at " + address +
                                          " (start it with: romap-server --listen " + address +
                                          "; if it uses TLS: --tls or --tls-ca FILE)");
}

TEST_F(RemoteMappingServiceTest, ConnectRejectsAServerThatIsNotRomap) {
  grpc::CallbackGenericService service_without_methods;
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.RegisterCallbackGenericService(&service_without_methods);
  const auto server = builder.BuildAndStart();
  const auto client = RemoteMappingService::Connect("127.0.0.1:" + std::to_string(port));
  EXPECT_CODE(client.status(), StatusCode::kUnavailable);
  EXPECT_THAT(Message(client.status()), HasSubstr("is not a working romap-server"));
}

TEST_F(RemoteMappingServiceTest, ServerShutdownEndsTheStream) {
  const auto stream = client_->OpenMap(NewSession()).value();
  server_.reset();
  testing_support::ReadToEnd(*stream);
  EXPECT_CODE(stream->status(), StatusCode::kUnavailable);
  EXPECT_CODE(stream->Send(testing_support::MakeFrame(1)), StatusCode::kUnavailable);
  EXPECT_FALSE(client_->ListSessions().ok());
}

TEST_F(RemoteMappingServiceTest, ReconnectsAfterServerRestart) {
  const std::string session = NewSession();
  const std::string address = server_->address();
  server_.reset();
  transport::TransportConfig config;
  config.listen_address = address;
  auto restarted = transport::GrpcServer::Start(&fake_, config);
  if (!restarted.ok()) GTEST_SKIP() << "another process took the port in the meantime";
  std::unique_ptr<MapStream> stream;
  ASSERT_TRUE(testing_support::Eventually([&] {
    auto opened = client_->OpenMap(session);
    if (opened.ok()) stream = *std::move(opened);
    return stream != nullptr;
  }));
  EXPECT_OK(stream->Send(testing_support::MakeFrame(1)));
  EXPECT_TRUE(testing_support::NextOf<FrameAck>(*stream).has_value());
}

TEST_F(RemoteMappingServiceTest, RejectsAnOversizedFrameAndKeepsTheStreamOpen) {
  const auto stream = client_->OpenMap(NewSession()).value();
  FrameInput frame = testing_support::MakeFrame(1);
  frame.image.assign(33 << 20, 'x');
  EXPECT_OK(stream->Send(std::move(frame)));
  EXPECT_OK(stream->Send(testing_support::MakeFrame(2)));
  EXPECT_OK(stream->CloseSend());
  const auto acks = testing_support::Only<FrameAck>(testing_support::ReadToEnd(*stream));
  ASSERT_THAT(acks, SizeIs(2));
  EXPECT_EQ(acks[0].frame_id, 1u);
  EXPECT_FALSE(acks[0].accepted);
  EXPECT_THAT(acks[0].error, HasSubstr("the limit is 33554432"));
  EXPECT_TRUE(acks[1].accepted);
}

TEST_F(RemoteMappingServiceTest, SendsAFrameJustBelowTheSizeLimit) {
  const auto stream = client_->OpenMap(NewSession()).value();
  FrameInput frame = testing_support::MakeFrame(1);
  frame.image.assign((32 << 20) - 1000, 'x');
  EXPECT_OK(stream->Send(std::move(frame)));
  const auto ack = testing_support::NextOf<FrameAck>(*stream);
  ASSERT_TRUE(ack.has_value());
  EXPECT_TRUE(ack->accepted);
}

TEST_F(RemoteMappingServiceTest, DeliversAllEventsToALateReader) {
  constexpr uint64_t kFrames = 500;  // three events each, more than the client buffers
  const auto stream = client_->OpenMap(NewSession()).value();
  for (uint64_t id = 1; id <= kFrames; ++id) ASSERT_TRUE(stream->Send(testing_support::MakeFrame(id, "mug")).ok());
  EXPECT_OK(stream->CloseSend());
  const auto acks = testing_support::Only<FrameAck>(testing_support::ReadToEnd(*stream));
  ASSERT_THAT(acks, SizeIs(kFrames));
  for (uint64_t i = 0; i < kFrames; ++i) ASSERT_EQ(acks[i].frame_id, i + 1);
}

TEST_F(RemoteMappingServiceTest, StreamCanBeDestroyedWithUnreadEvents) {
  const auto session = NewSession();
  const auto watch = client_->Watch(session).value();
  auto stream = client_->OpenMap(session).value();
  for (uint64_t id = 1; id <= 200; ++id) ASSERT_TRUE(stream->Send(testing_support::MakeFrame(id, "mug")).ok());
  stream.reset();
  EXPECT_TRUE(testing_support::Eventually([&] { return !fake_.GetSession(session)->stream_open; }));
}

TEST_F(RemoteMappingServiceTest, StreamOutlivesItsService) {
  const auto stream = client_->OpenMap(NewSession()).value();
  client_.reset();
  EXPECT_OK(stream->Send(testing_support::MakeFrame(1)));
  EXPECT_TRUE(testing_support::NextOf<FrameAck>(*stream).has_value());
}

// A server of another romap release.
class OtherServer : public v1::Mapping::Service {
 public:
  OtherServer() {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  ~OtherServer() override { server_->Shutdown(std::chrono::system_clock::now()); }

  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }

  grpc::Status ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest*, v1::ListSessionsResponse*) override {
    return grpc::Status::OK;
  }
  grpc::Status Watch(grpc::ServerContext*, const v1::WatchRequest*,
                     grpc::ServerWriter<v1::WatchResponse>* writer) override {
    v1::WatchResponse response;
    response.mutable_opened();
    writer->Write(response);
    response.mutable_event();  // of an event type unknown to this client
    writer->Write(response);
    *response.mutable_event() = wire::ToProto(MapEvent(FrameAck{}));
    response.mutable_event()->mutable_frame_ack()->set_state(static_cast<v1::TrackingState>(88));
    writer->Write(response);
    *response.mutable_event() = wire::ToProto(MapEvent(ObjectRemoved{.id = ObjectId{7}, .revision = 1, .reason = ""}));
    writer->Write(response);
    return grpc::Status::OK;
  }
  grpc::Status Map(grpc::ServerContext* context,
                   grpc::ServerReaderWriter<v1::MapResponse, v1::MapRequest>* /*stream*/) override {
    while (!context->IsCancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return grpc::Status::CANCELLED;
  }

 private:
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

TEST(RemoteMappingServiceOtherReleaseTest, IgnoresUnknownEvents) {
  OtherServer server;
  const auto client = RemoteMappingService::Connect(server.address()).value();
  const auto watch = client->Watch("any").value();
  const auto events = testing_support::ReadToEnd(*watch);
  ASSERT_THAT(events, SizeIs(1));
  EXPECT_EQ(std::get<ObjectRemoved>(events[0]).id, ObjectId{7});
  EXPECT_OK(watch->status());
}

TEST(RemoteMappingServiceOtherReleaseTest, OpenMapTimesOut) {
  OtherServer server;
  RemoteOptions options;
  options.call_timeout = std::chrono::milliseconds(300);
  const auto client = RemoteMappingService::Connect(server.address(), options).value();
  EXPECT_CODE(client->OpenMap("any").status(), StatusCode::kDeadlineExceeded);
}

}  // namespace romap::client::remote_mapping_service_test
