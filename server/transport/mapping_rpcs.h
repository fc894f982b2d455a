#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <functional>

#include "romap/v1/mapping.grpc.pb.h"
#include "server/transport/call_host.h"

namespace romap::transport {

// The gRPC service. Every handler converts the request, calls the MappingService of the caller, and converts the
// result.
class MappingRpcs : public v1::Mapping::CallbackService {
 public:
  // `first_request_timeout`: of a Map call; otherwise calls that never begin could take all threads.
  MappingRpcs(CallHost* host, std::chrono::milliseconds first_request_timeout)
      : host_(host), first_request_timeout_(first_request_timeout) {}

  grpc::ServerUnaryReactor* CreateSession(grpc::CallbackServerContext* context, const v1::CreateSessionRequest* request,
                                          v1::CreateSessionResponse* response) override;
  grpc::ServerUnaryReactor* ListSessions(grpc::CallbackServerContext* context, const v1::ListSessionsRequest* request,
                                         v1::ListSessionsResponse* response) override;
  grpc::ServerUnaryReactor* GetSession(grpc::CallbackServerContext* context, const v1::GetSessionRequest* request,
                                       v1::GetSessionResponse* response) override;
  grpc::ServerUnaryReactor* FinishSession(grpc::CallbackServerContext* context, const v1::FinishSessionRequest* request,
                                          v1::FinishSessionResponse* response) override;
  grpc::ServerUnaryReactor* DeleteSession(grpc::CallbackServerContext* context, const v1::DeleteSessionRequest* request,
                                          v1::DeleteSessionResponse* response) override;
  grpc::ServerBidiReactor<v1::MapRequest, v1::MapResponse>* Map(grpc::CallbackServerContext* context) override;
  grpc::ServerWriteReactor<v1::WatchResponse>* Watch(grpc::CallbackServerContext* context,
                                                     const v1::WatchRequest* request) override;
  grpc::ServerWriteReactor<v1::ExportMapResponse>* ExportMap(grpc::CallbackServerContext* context,
                                                             const v1::ExportMapRequest* request) override;
  grpc::ServerWriteReactor<v1::SaveSessionResponse>* SaveSession(grpc::CallbackServerContext* context,
                                                                 const v1::SaveSessionRequest* request) override;
  grpc::ServerReadReactor<v1::LoadSessionRequest>* LoadSession(grpc::CallbackServerContext* context,
                                                               v1::LoadSessionResponse* response) override;
  grpc::ServerUnaryReactor* PinSession(grpc::CallbackServerContext* context, const v1::PinSessionRequest* request,
                                       v1::PinSessionResponse* response) override;

 private:
  absl::StatusOr<access::Caller> CallerOf(const grpc::CallbackServerContext& context) const;
  // Runs `body` on its own thread, with the service as the caller sees it, and finishes the call with the status that
  // it returns. gRPC keeps request and response until then.
  grpc::ServerUnaryReactor* Run(grpc::CallbackServerContext* context,
                                std::function<absl::Status(MappingService& service)> body);

  CallHost* const host_;
  const std::chrono::milliseconds first_request_timeout_;
};

}  // namespace romap::transport
