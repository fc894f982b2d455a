// A client whose connection to the server is cut, stalled and delayed at random.

#include <map>
#include <random>
#include <thread>

#include "client/sdk/map_copy.h"
#include "client/sdk/remote_mapping_service.h"
#include "client/sdk/resuming_map_stream.h"
#include "server/transport/grpc_server.h"
#include "tests/contract/contract_fixture.h"
#include "tests/support/link_proxy.h"

namespace romap::contract::broken_link_test {

using ::testing::Each;
using ::testing::Pair;
using ::testing::SizeIs;

// Backends in process; the test puts gRPC and the proxy between.
std::vector<Backend> Servers() {
  std::vector<Backend> servers;
  for (const Backend& backend : AllBackends()) {
    if (!backend.over_grpc) servers.push_back(backend);
  }
  return servers;
}

class BrokenLink : public ::testing::TestWithParam<Backend> {
 protected:
  void SetUp() override {
    server_side_ = GetParam().make();
    transport::TransportConfig config;
    config.listen_address = "127.0.0.1:0";
    auto server = transport::GrpcServer::Start(server_side_.get(), config);
    ASSERT_TRUE(server.ok()) << Message(server.status());
    server_ = *std::move(server);
    proxy_ = std::make_unique<testing_support::LinkProxy>(server_->address());
    auto client = client::RemoteMappingService::Connect(proxy_->address());
    ASSERT_TRUE(client.ok()) << Message(client.status());
    client_ = *std::move(client);
    SessionOptions options;
    options.camera = SmallCamera();
    session_ = client_->CreateSession(options)->id;
    client::ResumeOptions resume;
    resume.retry.initial_delay = std::chrono::milliseconds(5);
    resume.retry.max_delay = std::chrono::milliseconds(100);
    auto stream = client::ResumingMapStream::Open(client_.get(), session_, resume);
    ASSERT_TRUE(stream.ok()) << Message(stream.status());
    stream_ = *std::move(stream);
  }

  std::unique_ptr<MappingService> server_side_;
  std::unique_ptr<transport::GrpcServer> server_;
  std::unique_ptr<testing_support::LinkProxy> proxy_;
  std::unique_ptr<client::RemoteMappingService> client_;
  std::string session_;
  std::unique_ptr<client::ResumingMapStream> stream_;
};
INSTANTIATE_TEST_SUITE_P(All, BrokenLink, ::testing::ValuesIn(Servers()),
                         [](const auto& info) { return info.param.name; });

TEST_P(BrokenLink, NothingIsLostOrTwiceThroughManyCuts) {
  constexpr uint64_t kFrames = 250;
  constexpr int kCuts = 7;
  std::thread damage([&] {
    std::mt19937 random(7);
    for (int i = 0; i < kCuts; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(200 + random() % 100));
      proxy_->SetDelay(std::chrono::milliseconds(random() % 4));
      if (i % 4 == 3) {
        proxy_->Stall(true);
        std::this_thread::sleep_for(std::chrono::milliseconds(30));
        proxy_->Stall(false);
      } else {
        proxy_->Cut(std::chrono::milliseconds(random() % 80));
      }
    }
    proxy_->SetDelay(std::chrono::milliseconds(0));
  });
  std::thread sender([&] {
    for (uint64_t id = 1; id <= kFrames; ++id) {
      EXPECT_OK(stream_->Send(MakeFrame(id, id % 3 == 0 ? "mug" : id % 3 == 1 ? "book" : "")));
      std::this_thread::sleep_for(std::chrono::milliseconds(8));
    }
    damage.join();
    EXPECT_OK(stream_->CloseSend());
  });
  std::map<uint64_t, int> acks;
  client::MapCopy copy;
  for (const MapEvent& event : ReadToEnd(*stream_)) {
    copy.Apply(event);
    if (const auto* ack = std::get_if<FrameAck>(&event)) {
      EXPECT_TRUE(ack->accepted) << ack->error;
      ++acks[ack->frame_id];
    }
  }
  sender.join();
  EXPECT_OK(stream_->status());
  EXPECT_THAT(acks, SizeIs(kFrames));
  EXPECT_THAT(acks, Each(Pair(::testing::_, 1)));
  EXPECT_GE(proxy_->connections(), 3);
  const MapSnapshot map = *server_side_->ExportMap(session_);
  ASSERT_THAT(map.trajectory, SizeIs(kFrames));
  for (uint64_t i = 0; i < kFrames; ++i) EXPECT_EQ(map.trajectory[i].frame_id, i + 1);
  EXPECT_EQ(map.statistics.frames_received, kFrames);
  if (GetParam().objects_from_one_frame) {
    EXPECT_THAT(copy.objects(), SizeIs(2));
  }
  for (const ObjectSnapshot& object : map.objects) {
    EXPECT_EQ(copy.objects().at(object.object.id).object.revision, object.object.revision);
  }
}

}  // namespace romap::contract::broken_link_test
