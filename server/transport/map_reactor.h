#pragma once

#include <optional>

#include "common/mapping_service.h"
#include "romap/v1/mapping.grpc.pb.h"
#include "server/transport/stream_reactor.h"

namespace romap::transport {

// One Map call: frames and late masks from the client to the MapStream, events from MapStream::Next to the client. The
// next request is read only when the stream has taken the last one; that is what slows the client down.
class MapReactor : public StreamReactor<grpc::ServerBidiReactor<v1::MapRequest, v1::MapResponse>, v1::MapResponse> {
 public:
  using StreamReactor::StreamReactor;

  void OnReadDone(bool ok) override { read_.Complete(ok); }

 private:
  absl::Status Run() override;
  void OnStop() override { read_.Abandon(); }

  // Waits for the next request, into request_; false when the client has closed its side, nullopt when the call stops.
  std::optional<bool> Read();
  // Body of the thread that reads requests.
  void PumpRequests(MapStream& stream);
  // Hands what is in request_ on, or refuses it; otherwise why the call must end.
  absl::Status TakeRequest(MapStream& stream);
  absl::Status TakeFrame(MapStream& stream);
  absl::Status TakeMasks(MapStream& stream);
  void Answer(MapEvent refusal);

  Completion read_;
  v1::MapRequest request_;
};

}  // namespace romap::transport
