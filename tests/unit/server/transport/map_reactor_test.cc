// Tests the Map call with generated stubs, including requests that client/sdk does not send.

#include "server/transport/map_reactor.h"

#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <gtest/gtest.h>

#include <vector>

#include "common/wire/frame.h"
#include "server/transport/grpc_server.h"
#include "tests/support/fake_mapping_service.h"
#include "tests/support/streams.h"

namespace romap::transport::map_reactor_test {

using ::testing::HasSubstr;
using testing_support::MakeFrame;

class MapReactorTest : public ::testing::Test {
 protected:
  MapReactorTest() { Start({}); }
  void Start(TransportConfig config) {
    config.listen_address = "127.0.0.1:0";
    server_ = GrpcServer::Start(&fake_, config).value();
    stub_ = v1::Mapping::NewStub(grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials()));
    session_ = fake_.CreateSession({.name = "", .camera = testing_support::SmallCamera()})->id;
    contexts_.push_back(std::make_unique<grpc::ClientContext>());
    call_ = stub_->Map(contexts_.back().get());
  }

  bool WriteStart() {
    v1::MapRequest request;
    request.mutable_start()->set_session_id(session_);
    return call_->Write(request);
  }
  bool WriteFrame(v1::Frame frame) {
    v1::MapRequest request;
    *request.mutable_frame() = std::move(frame);
    return call_->Write(request);
  }
  // The next one; other events may come before it.
  v1::FrameAck ReadFrameAck() {
    v1::MapResponse response;
    while (call_->Read(&response)) {
      if (response.event().has_frame_ack()) return response.event().frame_ack();
    }
    ADD_FAILURE() << "the stream ended";
    return {};
  }
  grpc::Status Finish() {
    for (v1::MapResponse response; call_->Read(&response);) {
    }
    return call_->Finish();
  }

  testing_support::FakeMappingService fake_;
  std::unique_ptr<GrpcServer> server_;
  std::unique_ptr<v1::Mapping::Stub> stub_;
  std::string session_;
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts_;  // of all calls; calls must end first
  std::unique_ptr<grpc::ClientReaderWriter<v1::MapRequest, v1::MapResponse>> call_;
};

TEST_F(MapReactorTest, FirstResponseIsOpened) {
  WriteStart();
  v1::MapResponse response;
  ASSERT_TRUE(call_->Read(&response));
  EXPECT_EQ(response.opened().session_id(), session_);
  call_->WritesDone();
  EXPECT_TRUE(Finish().ok());
}

// Otherwise such calls could take all threads of the server.
TEST_F(MapReactorTest, ACallThatNeverStartsIsEnded) {
  contexts_.back()->TryCancel();
  Finish();
  TransportConfig impatient;
  impatient.handshake_timeout_s = 0.2;
  Start(impatient);
  const grpc::Status status = Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
  EXPECT_EQ(status.error_message(), "map: the first request, `start`, did not come within 200 ms");
}

TEST_F(MapReactorTest, FrameBeforeStartIsRejected) {
  WriteFrame(wire::ToProto(testing_support::MakeFrame(1)));
  const grpc::Status status = Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), HasSubstr("first request must be `start`"));
}

TEST_F(MapReactorTest, StreamWithoutStartIsRejected) {
  call_->WritesDone();
  EXPECT_EQ(Finish().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(MapReactorTest, SecondStartEndsTheStreamAndFreesTheSession) {
  WriteStart();
  WriteStart();
  const grpc::Status status = Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), HasSubstr("must be `frame` or `late_masks`"));
  EXPECT_FALSE(fake_.GetSession(session_)->stream_open) << "must be false before the client receives the status";
}

TEST_F(MapReactorTest, MalformedLateMasksAreRejectedWithTheField) {
  WriteStart();
  WriteFrame(wire::ToProto(testing_support::MakeFrame(1)));
  v1::MapRequest request;
  request.mutable_late_masks()->set_frame_id(1);
  request.mutable_late_masks()->mutable_masks()->set_label_png("");
  call_->Write(request);
  request.mutable_late_masks()->mutable_masks()->set_label_png("png");
  call_->Write(request);
  call_->WritesDone();
  std::vector<v1::MasksAck> acks;
  for (v1::MapResponse response; call_->Read(&response);) {
    if (response.event().has_masks_ack()) acks.push_back(response.event().masks_ack());
  }
  EXPECT_TRUE(call_->Finish().ok());
  ASSERT_EQ(acks.size(), 2u);
  EXPECT_EQ(acks[0].frame_id(), 1u);
  EXPECT_FALSE(acks[0].accepted());
  EXPECT_EQ(acks[0].error(), "late_masks.masks.label_png: missing");
  EXPECT_TRUE(acks[1].accepted());
}

TEST_F(MapReactorTest, UnknownEnumValueIsRejectedWithTheField) {
  WriteStart();
  v1::Frame frame = wire::ToProto(testing_support::MakeFrame(1));
  frame.mutable_image()->set_encoding(static_cast<v1::ImageEncoding>(77));
  WriteFrame(frame);
  const v1::FrameAck rejected = ReadFrameAck();
  EXPECT_EQ(rejected.frame_id(), 1u);
  EXPECT_FALSE(rejected.accepted());
  EXPECT_THAT(rejected.error(), HasSubstr("frame.image.encoding: must be one of"));

  WriteFrame(wire::ToProto(testing_support::MakeFrame(2)));
  const v1::FrameAck accepted = ReadFrameAck();
  EXPECT_EQ(accepted.frame_id(), 2u);
  EXPECT_TRUE(accepted.accepted());
  call_->WritesDone();
  EXPECT_TRUE(Finish().ok());
}

}  // namespace romap::transport::map_reactor_test
