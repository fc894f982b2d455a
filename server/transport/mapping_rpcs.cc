#include "server/transport/mapping_rpcs.h"

#include <memory>
#include <string>
#include <utility>

#include "common/status.h"
#include "common/wire/sessions.h"
#include "common/wire/status.h"
#include "server/transport/load_reactor.h"
#include "server/transport/map_reactor.h"
#include "server/transport/stream_reactor.h"

namespace romap::transport {
namespace {

class WatchReactor : public StreamReactor<grpc::ServerWriteReactor<v1::WatchResponse>, v1::WatchResponse> {
 public:
  WatchReactor(CallHost* host, absl::StatusOr<access::Caller> caller, std::string session_id)
      : StreamReactor(host, std::move(caller)), session_id_(std::move(session_id)) {}

 private:
  absl::Status Run() override {
    ROMAP_ASSIGN_OR_RETURN(const std::unique_ptr<EventStream> events, service().Watch(session_id_));
    return ForwardEvents(session_id_, *events);
  }

  const std::string session_id_;
};

class ExportReactor : public StreamReactor<grpc::ServerWriteReactor<v1::ExportMapResponse>, v1::ExportMapResponse> {
 public:
  ExportReactor(CallHost* host, absl::StatusOr<access::Caller> caller, std::string session_id)
      : StreamReactor(host, std::move(caller)), session_id_(std::move(session_id)) {}

 private:
  absl::Status Run() override {
    ROMAP_ASSIGN_OR_RETURN(MapSnapshot snapshot, service().ExportMap(session_id_));
    for (const v1::ExportMapResponse& part : wire::ToProto(std::move(snapshot))) {
      if (stopping() || !Write(part)) return absl::CancelledError("the client disconnected");
    }
    return absl::OkStatus();
  }

  const std::string session_id_;
};

class SaveReactor : public StreamReactor<grpc::ServerWriteReactor<v1::SaveSessionResponse>, v1::SaveSessionResponse> {
 public:
  SaveReactor(CallHost* host, absl::StatusOr<access::Caller> caller, std::string session_id)
      : StreamReactor(host, std::move(caller)), session_id_(std::move(session_id)) {}

 private:
  absl::Status Run() override {
    return service().SaveSession(session_id_, [this](std::string piece) -> absl::Status {
      v1::SaveSessionResponse response;
      response.set_piece(std::move(piece));
      if (stopping() || !Write(response)) return absl::CancelledError("the client disconnected");
      return absl::OkStatus();
    });
  }

  const std::string session_id_;
};

std::string AuthorizationOf(const grpc::CallbackServerContext& context) {
  const auto found = context.client_metadata().find("authorization");
  return found == context.client_metadata().end() ? "" : std::string(found->second.data(), found->second.size());
}

template <class StreamReactor>
StreamReactor* Started(StreamReactor* reactor) {
  reactor->Start();
  return reactor;
}

}  // namespace

absl::StatusOr<access::Caller> MappingRpcs::CallerOf(const grpc::CallbackServerContext& context) const {
  return host_->authenticator().Authenticate(AuthorizationOf(context));
}

grpc::ServerUnaryReactor* MappingRpcs::Run(grpc::CallbackServerContext* context,
                                           std::function<absl::Status(MappingService& service)> body) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const absl::StatusOr<access::Caller> caller = CallerOf(*context);
  if (!caller.ok()) {
    reactor->Finish(wire::ToGrpc(caller.status()));
    return reactor;
  }
  const absl::Status launched = host_->Launch(nullptr, [reactor, service = caller->service, body = std::move(body)] {
    reactor->Finish(wire::ToGrpc(Guarded([&] { return body(*service); })));
  });
  if (!launched.ok()) reactor->Finish(wire::ToGrpc(launched));
  return reactor;
}

grpc::ServerUnaryReactor* MappingRpcs::CreateSession(grpc::CallbackServerContext* context,
                                                     const v1::CreateSessionRequest* request,
                                                     v1::CreateSessionResponse* response) {
  return Run(context, [=](MappingService& service) -> absl::Status {
    ROMAP_ASSIGN_OR_RETURN(const SessionOptions options, wire::FromProto(*request));
    ROMAP_ASSIGN_OR_RETURN(const SessionInfo info, service.CreateSession(options));
    *response->mutable_session() = wire::ToProto(info);
    return absl::OkStatus();
  });
}

grpc::ServerUnaryReactor* MappingRpcs::ListSessions(grpc::CallbackServerContext* context,
                                                    const v1::ListSessionsRequest* /*request*/,
                                                    v1::ListSessionsResponse* response) {
  return Run(context, [=](MappingService& service) -> absl::Status {
    ROMAP_ASSIGN_OR_RETURN(const std::vector<SessionInfo> infos, service.ListSessions());
    for (const SessionInfo& info : infos) *response->add_sessions() = wire::ToProto(info);
    return absl::OkStatus();
  });
}

grpc::ServerUnaryReactor* MappingRpcs::GetSession(grpc::CallbackServerContext* context,
                                                  const v1::GetSessionRequest* request,
                                                  v1::GetSessionResponse* response) {
  return Run(context, [=](MappingService& service) -> absl::Status {
    ROMAP_ASSIGN_OR_RETURN(const SessionInfo info, service.GetSession(request->session_id()));
    *response->mutable_session() = wire::ToProto(info);
    return absl::OkStatus();
  });
}

grpc::ServerUnaryReactor* MappingRpcs::FinishSession(grpc::CallbackServerContext* context,
                                                     const v1::FinishSessionRequest* request,
                                                     v1::FinishSessionResponse* response) {
  return Run(context, [=](MappingService& service) -> absl::Status {
    ROMAP_ASSIGN_OR_RETURN(const SessionInfo info, service.FinishSession(request->session_id()));
    *response->mutable_session() = wire::ToProto(info);
    return absl::OkStatus();
  });
}

grpc::ServerUnaryReactor* MappingRpcs::DeleteSession(grpc::CallbackServerContext* context,
                                                     const v1::DeleteSessionRequest* request,
                                                     v1::DeleteSessionResponse* /*response*/) {
  return Run(context, [=](MappingService& service) { return service.DeleteSession(request->session_id()); });
}

grpc::ServerBidiReactor<v1::MapRequest, v1::MapResponse>* MappingRpcs::Map(grpc::CallbackServerContext* context) {
  return Started(new MapReactor(host_, CallerOf(*context), first_request_timeout_));
}

grpc::ServerWriteReactor<v1::WatchResponse>* MappingRpcs::Watch(grpc::CallbackServerContext* context,
                                                                const v1::WatchRequest* request) {
  return Started(new WatchReactor(host_, CallerOf(*context), request->session_id()));
}

grpc::ServerWriteReactor<v1::ExportMapResponse>* MappingRpcs::ExportMap(grpc::CallbackServerContext* context,
                                                                        const v1::ExportMapRequest* request) {
  return Started(new ExportReactor(host_, CallerOf(*context), request->session_id()));
}

grpc::ServerWriteReactor<v1::SaveSessionResponse>* MappingRpcs::SaveSession(grpc::CallbackServerContext* context,
                                                                            const v1::SaveSessionRequest* request) {
  return Started(new SaveReactor(host_, CallerOf(*context), request->session_id()));
}

grpc::ServerReadReactor<v1::LoadSessionRequest>* MappingRpcs::LoadSession(grpc::CallbackServerContext* context,
                                                                          v1::LoadSessionResponse* response) {
  return Started(new LoadReactor(host_, CallerOf(*context), response));
}

grpc::ServerUnaryReactor* MappingRpcs::PinSession(grpc::CallbackServerContext* context,
                                                  const v1::PinSessionRequest* request,
                                                  v1::PinSessionResponse* response) {
  return Run(context, [=](MappingService& service) -> absl::Status {
    ROMAP_ASSIGN_OR_RETURN(const SessionInfo info, service.PinSession(request->session_id(), request->pinned()));
    *response->mutable_session() = wire::ToProto(info);
    return absl::OkStatus();
  });
}

}  // namespace romap::transport
