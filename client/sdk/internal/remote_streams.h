#pragma once

#include <absl/status/statusor.h>

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "client/sdk/internal/event_reactor.h"
#include "common/mapping_service.h"
#include "romap/v1/mapping.grpc.pb.h"

namespace romap::client {

// The streams of RemoteMappingService. Each stream holds the stub, which keeps the channel of its call open.

// A Watch stream.
class RemoteWatchStream : public EventStream {
 public:
  // Waits up to `timeout` until the server has opened the stream. Errors as EventReactor::Begin().
  static absl::StatusOr<std::unique_ptr<EventStream>> Open(std::shared_ptr<v1::Mapping::Stub> stub,
                                                           const std::string& session_id,
                                                           std::chrono::milliseconds timeout);

  const StreamOpening& opening() const override { return reactor_.opening(); }
  std::optional<MapEvent> Next(std::chrono::milliseconds timeout) override { return reactor_.Next(timeout); }
  bool Done() const override { return reactor_.Done(); }
  absl::Status status() const override { return reactor_.status(); }
  void Cancel() override { reactor_.Cancel(); }

 private:
  class Reactor : public EventReactor<grpc::ClientReadReactor<v1::WatchResponse>, v1::WatchResponse> {
   public:
    ~Reactor() override { Shutdown(); }
  };

  explicit RemoteWatchStream(std::shared_ptr<v1::Mapping::Stub> stub) : stub_(std::move(stub)) {}

  const std::shared_ptr<v1::Mapping::Stub> stub_;
  v1::WatchRequest request_;
  Reactor reactor_;
};

// A Map stream.
class RemoteMapStream : public MapStream {
 public:
  // As RemoteWatchStream::Open(). Requests of more than max_message_bytes are rejected locally.
  static absl::StatusOr<std::unique_ptr<MapStream>> Open(std::shared_ptr<v1::Mapping::Stub> stub,
                                                         const std::string& session_id, const std::string& resume_token,
                                                         std::chrono::milliseconds timeout, int max_message_bytes);

  const StreamOpening& opening() const override { return reactor_.opening(); }
  std::optional<MapEvent> Next(std::chrono::milliseconds timeout) override { return reactor_.Next(timeout); }
  bool Done() const override { return reactor_.Done(); }
  absl::Status status() const override { return reactor_.status(); }
  void Cancel() override { reactor_.Cancel(); }
  absl::Status Send(FrameInput frame) override { return reactor_.Send(std::move(frame)); }
  absl::Status SendMasks(MasksInput masks) override { return reactor_.SendMasks(std::move(masks)); }
  absl::Status CloseSend() override { return reactor_.CloseSend(); }

 private:
  // The sending half. At most one write is pending at a time, as gRPC requires.
  class Reactor : public EventReactor<grpc::ClientBidiReactor<v1::MapRequest, v1::MapResponse>, v1::MapResponse> {
   public:
    explicit Reactor(int max_message_bytes) : max_message_bytes_(max_message_bytes) {}
    ~Reactor() override { Shutdown(); }

    // Queues the first request. Call before Begin(), which sends it.
    void QueueStart(const std::string& session_id, const std::string& resume_token);
    absl::Status Send(FrameInput frame);
    absl::Status SendMasks(MasksInput masks);
    absl::Status CloseSend();
    void OnWriteDone(bool ok) override;

   private:
    // Writes one request. If it exceeds max_message_bytes_, delivers `rejection` with the reason instead.
    template <class Ack>
    absl::Status SendRequest(v1::MapRequest request, Ack rejection);
    absl::Status WaitForWrite();

    const int max_message_bytes_;
    std::mutex send_mutex_;  // serializes Send(), SendMasks() and CloseSend()
    v1::MapRequest request_;
    bool send_closed_ = false;

    std::mutex write_mutex_;
    std::condition_variable write_changed_;
    bool write_pending_ = false;
    bool write_failed_ = false;
  };

  RemoteMapStream(std::shared_ptr<v1::Mapping::Stub> stub, int max_message_bytes)
      : stub_(std::move(stub)), reactor_(max_message_bytes) {}

  const std::shared_ptr<v1::Mapping::Stub> stub_;
  Reactor reactor_;
};

}  // namespace romap::client
