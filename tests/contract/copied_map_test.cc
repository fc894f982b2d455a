// Compares client-side copies of a changing map, updated over gRPC, with the map.

#include <gmock/gmock.h>

#include <atomic>
#include <thread>

#include "client/sdk/remote_mapping_service.h"
#include "server/session/map_state.h"
#include "server/transport/grpc_server.h"
#include "tests/support/checked_copy.h"
#include "tests/support/fake_mapping_service.h"
#include "tests/support/random_map.h"
#include "tests/support/streams.h"

namespace romap::copied_map_test {

using testing_support::CheckedCopy;
using testing_support::RandomMap;

class OutboxStream : public EventStream {
 public:
  explicit OutboxStream(std::shared_ptr<session::Outbox> outbox) : outbox_(std::move(outbox)) {}
  const StreamOpening& opening() const override { return opening_; }
  std::optional<MapEvent> Next(std::chrono::milliseconds timeout) override { return outbox_->Next(timeout); }
  bool Done() const override { return outbox_->Done(); }
  absl::Status status() const override { return outbox_->status(); }
  void Cancel() override { outbox_->Close(absl::CancelledError("the stream was canceled")); }

 private:
  const std::shared_ptr<session::Outbox> outbox_;
  const StreamOpening opening_;
};

// Every Watch() subscribes to the same map, whatever the session id.
class SharedMapService : public testing_support::FakeMappingService {
 public:
  absl::StatusOr<std::unique_ptr<EventStream>> Watch(const std::string& /*session_id*/) override {
    return std::make_unique<OutboxStream>(map.Subscribe(session::Outbox::Acks::kNewest, 1));
  }
  session::MapState map;
};

void ReadToEnd(EventStream& stream, testing_support::CheckedCopy& copy, std::chrono::microseconds pause) {
  const auto deadline = std::chrono::steady_clock::now() + testing_support::kTimeout;
  while (!stream.Done()) {
    if (std::chrono::steady_clock::now() > deadline) {
      ADD_FAILURE() << "the stream did not end within " << testing_support::kTimeout.count() << " s";
      return;
    }
    if (const auto event = stream.Next(std::chrono::milliseconds(100))) copy.Apply(*event);
    std::this_thread::sleep_for(pause);
  }
}

TEST(CopiedMapOverGrpc, EqualsTheMapForFastAndSlowReaders) {
  SharedMapService service;
  transport::TransportConfig config;
  config.listen_address = "127.0.0.1:0";
  const auto server = transport::GrpcServer::Start(&service, config).value();
  const auto remote = client::RemoteMappingService::Connect(server->address()).value();
  testing_support::CheckedCopy fast, slow, late, truth;
  const auto fast_stream = remote->Watch("any").value(), slow_stream = remote->Watch("any").value();
  std::thread fast_reader([&] { ReadToEnd(*fast_stream, fast, std::chrono::microseconds(0)); });
  std::thread slow_reader([&] { ReadToEnd(*slow_stream, slow, std::chrono::microseconds(300)); });
  testing_support::RandomMap random(7, &service.map);
  for (int step = 0; step < 6000; ++step) random.Step();
  const auto late_stream = remote->Watch("any").value();
  std::thread late_reader([&] { ReadToEnd(*late_stream, late, std::chrono::microseconds(0)); });
  for (int step = 0; step < 2000; ++step) random.Step();
  const auto all = service.map.Subscribe(session::Outbox::Acks::kAll, 16);
  service.map.Close(absl::OkStatus());
  for (std::thread* reader : {&fast_reader, &slow_reader, &late_reader}) reader->join();
  OutboxStream truth_stream(all);
  ReadToEnd(truth_stream, truth, std::chrono::microseconds(0));
  EXPECT_FALSE(truth.Bytes().empty());
  EXPECT_EQ(fast.Bytes(), truth.Bytes());
  EXPECT_EQ(slow.Bytes(), truth.Bytes());
  EXPECT_EQ(late.Bytes(), truth.Bytes());
  EXPECT_OK(slow_stream->status());
}

}  // namespace romap::copied_map_test
