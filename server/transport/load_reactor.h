#pragma once

#include <optional>
#include <string>

#include "romap/v1/mapping.grpc.pb.h"
#include "server/transport/stream_reactor.h"

namespace romap::transport {

// One LoadSession call: passes the pieces of the file to the service. The work is done on its own thread. Must be
// created with new; deletes itself when gRPC no longer needs it.
class LoadReactor : public grpc::ServerReadReactor<v1::LoadSessionRequest>, public StoppableCall {
 public:
  // gRPC keeps `response` until the call ends.
  LoadReactor(CallHost* host, absl::StatusOr<access::Caller> caller, v1::LoadSessionResponse* response)
      : host_(host), caller_(std::move(caller)), response_(response) {}

  // Call once, after construction.
  void Start();

  void OnReadDone(bool ok) override { read_.Complete(ok); }
  void OnCancel() override { RequestStop(absl::CancelledError("the client disconnected")); }
  void OnDone() override;
  void RequestStop(const absl::Status& reason) override;

 private:
  absl::Status Run();
  absl::StatusOr<std::string> NextPiece();

  CallHost* const host_;
  const absl::StatusOr<access::Caller> caller_;  // an error ends the call
  v1::LoadSessionResponse* const response_;
  v1::LoadSessionRequest request_;
  Completion read_;
  std::mutex mutex_;
  std::optional<absl::Status> stop_reason_;
};

}  // namespace romap::transport
