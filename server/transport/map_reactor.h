#pragma once

#include <chrono>
#include <optional>
#include <utility>

#include "common/mapping_service.h"
#include "romap/v1/mapping.grpc.pb.h"
#include "server/transport/stream_reactor.h"

namespace romap::transport {

// One Map call: passes frames and late masks from the client to the MapStream, and events from MapStream::Next() to the
// client. A request is read only after the stream has accepted the previous one; this slows the client down if the
// session cannot keep up.
class MapReactor : public StreamReactor<grpc::ServerBidiReactor<v1::MapRequest, v1::MapResponse>, v1::MapResponse> {
 public:
  MapReactor(CallHost* host, absl::StatusOr<access::Caller> caller, std::chrono::milliseconds first_request_timeout)
      : StreamReactor(host, std::move(caller)), first_request_timeout_(first_request_timeout) {}

  void OnReadDone(bool ok) override { read_.Complete(ok); }

 private:
  absl::Status Run() override;
  void OnStop() override { read_.Abandon(); }

  absl::Status ReadStart();
  // Waits for the next request and stores it in request_. False: the client has closed its side. nullopt: the call is
  // being stopped.
  std::optional<bool> Read();
  // Reads requests; runs on its own thread.
  void PumpRequests(MapStream& stream);
  // Processes request_. An invalid frame or masks are rejected by an event; an error status ends the call.
  absl::Status HandleRequest(MapStream& stream);
  absl::Status HandleFrame(MapStream& stream);
  absl::Status HandleMasks(MapStream& stream);
  void WriteEvent(MapEvent event);

  const std::chrono::milliseconds first_request_timeout_;
  Completion read_;
  v1::MapRequest request_;
};

}  // namespace romap::transport
