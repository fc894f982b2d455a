#include "client/sdk/remote_mapping_service.h"

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include <utility>

#include "client/sdk/internal/channel.h"
#include "client/sdk/internal/remote_streams.h"
#include "client/sdk/retry.h"
#include "common/status.h"
#include "common/wire/sessions.h"
#include "common/wire/status.h"
#include "romap/v1/mapping.grpc.pb.h"

namespace romap::client {
namespace {

using std::chrono::system_clock;

// The context of a call with a deadline.
struct TimedContext : grpc::ClientContext {
  explicit TimedContext(std::chrono::milliseconds timeout) { set_deadline(system_clock::now() + timeout); }
};

}  // namespace

struct RemoteMappingService::Connection {
  RemoteOptions options;
  std::shared_ptr<v1::Mapping::Stub> stub;
};

absl::StatusOr<std::unique_ptr<RemoteMappingService>> RemoteMappingService::ConnectOnce(const std::string& host_port,
                                                                                        const RemoteOptions& options) {
  ROMAP_ASSIGN_OR_RETURN(const std::shared_ptr<grpc::Channel> channel, MakeChannel(host_port, options));
  if (!channel->WaitForConnected(system_clock::now() + options.connect_timeout)) {
    return absl::UnavailableError(
        options.tls.enabled
            ? fmt::format("cannot connect to romap-server at {} with TLS (does it run there, with TLS, and did the CA "
                          "sign its certificate for this name?)",
                          host_port)
            : fmt::format("cannot connect to romap-server at {0} (start it with: romap-server --listen {0}; if it uses "
                          "TLS: --tls or --tls-ca FILE)",
                          host_port));
  }
  std::unique_ptr<Connection> connection(new Connection{options, v1::Mapping::NewStub(channel)});
  std::unique_ptr<RemoteMappingService> service(new RemoteMappingService(std::move(connection)));
  // A TCP connection does not prove that the peer is a romap-server.
  if (const absl::Status listed = service->ListSessions().status(); !listed.ok()) {
    if (absl::IsUnauthenticated(listed) || absl::IsPermissionDenied(listed)) return listed;
    return absl::UnavailableError(
        fmt::format("{} accepts connections but is not a working romap-server: {}", host_port, Message(listed)));
  }
  return service;
}

absl::StatusOr<std::unique_ptr<RemoteMappingService>> RemoteMappingService::Connect(const std::string& host_port,
                                                                                    const RemoteOptions& options) {
  RetryOptions retry;
  retry.max_down = options.wait;
  return RetryWhileUnavailable([&] { return ConnectOnce(host_port, options); }, retry);
}

RemoteMappingService::RemoteMappingService(std::unique_ptr<Connection> connection)
    : connection_(std::move(connection)) {}
RemoteMappingService::~RemoteMappingService() = default;

absl::StatusOr<SessionInfo> RemoteMappingService::CreateSession(const SessionOptions& options) {
  TimedContext context(connection_->options.call_timeout);
  v1::CreateSessionResponse response;
  ROMAP_RETURN_IF_ERROR(wire::FromGrpc(connection_->stub->CreateSession(&context, wire::ToProto(options), &response)));
  return wire::FromProto(response.session(), "session");
}

absl::StatusOr<std::vector<SessionInfo>> RemoteMappingService::ListSessions() {
  TimedContext context(connection_->options.call_timeout);
  v1::ListSessionsResponse response;
  ROMAP_RETURN_IF_ERROR(wire::FromGrpc(connection_->stub->ListSessions(&context, {}, &response)));
  std::vector<SessionInfo> infos;
  for (const v1::SessionInfo& session : response.sessions()) {
    ROMAP_ASSIGN_OR_RETURN(SessionInfo info, wire::FromProto(session, fmt::format("sessions[{}]", infos.size())));
    infos.push_back(std::move(info));
  }
  return infos;
}

absl::StatusOr<SessionInfo> RemoteMappingService::GetSession(const std::string& session_id) {
  TimedContext context(connection_->options.call_timeout);
  v1::GetSessionRequest request;
  request.set_session_id(session_id);
  v1::GetSessionResponse response;
  ROMAP_RETURN_IF_ERROR(wire::FromGrpc(connection_->stub->GetSession(&context, request, &response)));
  return wire::FromProto(response.session(), "session");
}

absl::StatusOr<SessionInfo> RemoteMappingService::FinishSession(const std::string& session_id) {
  TimedContext context(connection_->options.call_timeout);
  v1::FinishSessionRequest request;
  request.set_session_id(session_id);
  v1::FinishSessionResponse response;
  ROMAP_RETURN_IF_ERROR(wire::FromGrpc(connection_->stub->FinishSession(&context, request, &response)));
  return wire::FromProto(response.session(), "session");
}

absl::Status RemoteMappingService::DeleteSession(const std::string& session_id) {
  TimedContext context(connection_->options.call_timeout);
  v1::DeleteSessionRequest request;
  request.set_session_id(session_id);
  v1::DeleteSessionResponse response;
  return wire::FromGrpc(connection_->stub->DeleteSession(&context, request, &response));
}

absl::StatusOr<std::unique_ptr<MapStream>> RemoteMappingService::OpenMap(const std::string& session_id,
                                                                         const std::string& resume_token) {
  return RemoteMapStream::Open(connection_->stub, session_id, resume_token, connection_->options.call_timeout,
                               connection_->options.max_message_bytes);
}

absl::StatusOr<std::unique_ptr<EventStream>> RemoteMappingService::Watch(const std::string& session_id) {
  return RemoteWatchStream::Open(connection_->stub, session_id, connection_->options.call_timeout);
}

absl::StatusOr<MapSnapshot> RemoteMappingService::ExportMap(const std::string& session_id) {
  TimedContext context(connection_->options.export_timeout);
  v1::ExportMapRequest request;
  request.set_session_id(session_id);
  const auto reader = connection_->stub->ExportMap(&context, request);
  wire::SnapshotAssembler assembler;
  absl::Status assembled;
  for (v1::ExportMapResponse part; assembled.ok() && reader->Read(&part);) assembled = assembler.Add(std::move(part));
  if (!assembled.ok()) context.TryCancel();
  const grpc::Status finished = reader->Finish();
  ROMAP_RETURN_IF_ERROR(assembled);
  ROMAP_RETURN_IF_ERROR(wire::FromGrpc(finished));
  return assembler.Take();
}

absl::Status RemoteMappingService::SaveSession(const std::string& session_id, const PieceWriter& write) {
  TimedContext context(connection_->options.export_timeout);
  v1::SaveSessionRequest request;
  request.set_session_id(session_id);
  const auto reader = connection_->stub->SaveSession(&context, request);
  absl::Status written;
  for (v1::SaveSessionResponse piece; written.ok() && reader->Read(&piece);) {
    written = write(std::move(*piece.mutable_piece()));
  }
  if (!written.ok()) context.TryCancel();
  const grpc::Status finished = reader->Finish();
  ROMAP_RETURN_IF_ERROR(written);
  return wire::FromGrpc(finished);
}

absl::StatusOr<SessionInfo> RemoteMappingService::LoadSession(const PieceReader& read, const std::string& /*tenant*/) {
  TimedContext context(connection_->options.export_timeout);
  v1::LoadSessionResponse response;
  const auto writer = connection_->stub->LoadSession(&context, &response);
  absl::Status failed;
  while (true) {
    absl::StatusOr<std::string> piece = read();
    if (!piece.ok()) failed = piece.status();
    if (!piece.ok() || piece->empty()) break;
    v1::LoadSessionRequest request;
    request.set_piece(*std::move(piece));
    if (!writer->Write(request)) break;  // the status says why
  }
  if (failed.ok()) {
    writer->WritesDone();
  } else {
    context.TryCancel();
  }
  const grpc::Status finished = writer->Finish();
  ROMAP_RETURN_IF_ERROR(failed);
  ROMAP_RETURN_IF_ERROR(wire::FromGrpc(finished));
  return wire::FromProto(response.session(), "session");
}

absl::StatusOr<SessionInfo> RemoteMappingService::PinSession(const std::string& session_id, bool pinned) {
  TimedContext context(connection_->options.call_timeout);
  v1::PinSessionRequest request;
  request.set_session_id(session_id);
  request.set_pinned(pinned);
  v1::PinSessionResponse response;
  ROMAP_RETURN_IF_ERROR(wire::FromGrpc(connection_->stub->PinSession(&context, request, &response)));
  return wire::FromProto(response.session(), "session");
}

}  // namespace romap::client
