#include "server/transport/malformed_requests.h"

#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/security/credentials.h>

#include <future>

#include "server/transport/grpc_server.h"
#include "tests/support/fake_mapping_service.h"
#include "tests/support/streams.h"

namespace romap::transport::malformed_requests_test {

class MalformedRequestsTest : public ::testing::Test {
 protected:
  // Makes a call with one request of these bytes.
  grpc::Status Call(const std::string& name, const std::string& bytes) {
    const grpc::Slice slice(bytes);
    const grpc::ByteBuffer request(&slice, 1);
    grpc::ByteBuffer response;
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + testing_support::kTimeout);
    std::promise<grpc::Status> status;
    stub_.UnaryCall(&context, "/romap.v1.Mapping/" + name, {}, &request, &response,
                    [&](const grpc::Status& result) { status.set_value(result); });
    return status.get_future().get();
  }

  testing_support::FakeMappingService fake_;
  const TransportConfig config_ = [] {
    TransportConfig config;
    config.listen_address = "127.0.0.1:0";
    return config;
  }();
  const std::unique_ptr<GrpcServer> server_ = GrpcServer::Start(&fake_, config_).value();
  grpc::GenericStub stub_{grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials())};
};

TEST_F(MalformedRequestsTest, RequestsThatAreNoMessagesAreInvalid) {
  for (const std::string name : {"CreateSession", "GetSession", "DeleteSession", "PinSession", "Watch", "ExportMap"}) {
    const grpc::Status status = Call(name, "\xff\xff\xff\xff");
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << name;
    EXPECT_EQ(status.error_message(), "/romap.v1.Mapping/" + name + ": the request is not a valid message of its type");
  }
}

TEST_F(MalformedRequestsTest, TextsThatAreNotUtf8WriteNothingToStderr) {
  RouteGrpcLogToSpdlog();
  ::testing::internal::CaptureStderr();
  const grpc::Status status = Call("GetSession", "\x0a\x01\xff");  // session_id
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(MalformedRequestsTest, OtherErrorsStay) {
  EXPECT_TRUE(Call("ListSessions", "").ok());
  EXPECT_EQ(Call("GetSession", "").error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(Call("NoSuchCall", "").error_code(), grpc::StatusCode::UNIMPLEMENTED);
}

}  // namespace romap::transport::malformed_requests_test
