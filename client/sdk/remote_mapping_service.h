#pragma once

#include <absl/status/statusor.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "common/mapping_service.h"

namespace romap::client {

// How the client proves the server's identity and its own.
struct TlsOptions {
  bool enabled = false;
  std::string ca_file;                // PEM; who may have signed the server's certificate; empty = as the system says
  std::string certificate, key_file;  // PEM files of the client's own certificate, for servers that want one; or empty
  std::string server_name;            // in the server's certificate; empty = the host of the address
};

struct RemoteOptions {
  std::chrono::milliseconds connect_timeout{3000};
  std::chrono::milliseconds wait{0};                  // Connect() waits so long for a server that is not there yet
  std::chrono::milliseconds call_timeout{30'000};     // per unary call, and for opening a stream
  std::chrono::milliseconds export_timeout{300'000};  // for a whole ExportMap()
  int max_message_bytes = 32 << 20;                   // must match transport.max_message_bytes of the server
  std::string token = {};                             // for servers that need one; sent only with TLS or on loopback
  TlsOptions tls = {};
};

// A MappingService that calls a romap-server over gRPC (HTTP/2), with or without TLS.
//
// Thread-safe. Streams share ownership of the connection and may outlive this object.
//
// gRPC reconnects automatically. When the connection breaks, open streams end with UNAVAILABLE. The session stays on
// the server; call OpenMap() again to continue it, or use ResumingMapStream, which does and loses nothing.
//
// Errors: in addition to those of MappingService, every call may return UNAVAILABLE (no connection to the server),
// DEADLINE_EXCEEDED (a timeout of RemoteOptions), INVALID_ARGUMENT for a malformed response, UNAUTHENTICATED (the
// server wants a valid token), and PERMISSION_DENIED (the role of the token does not allow the call).
class RemoteMappingService : public MappingService {
 public:
  // Connects to a server and verifies that it is a romap-server. `host_port`: e.g. "127.0.0.1:50051".
  // Errors: UNAVAILABLE if no romap-server responds within the times of `options`; UNAUTHENTICATED; INVALID_ARGUMENT if
  // a token would be sent in clear text to another machine; as FileError() for a TLS file.
  static absl::StatusOr<std::unique_ptr<RemoteMappingService>> Connect(const std::string& host_port,
                                                                       const RemoteOptions& options = {});

  ~RemoteMappingService() override;

  absl::StatusOr<SessionInfo> CreateSession(const SessionOptions& options) override;
  absl::StatusOr<std::vector<SessionInfo>> ListSessions() override;
  absl::StatusOr<SessionInfo> GetSession(const std::string& session_id) override;
  absl::StatusOr<SessionInfo> FinishSession(const std::string& session_id) override;
  absl::Status DeleteSession(const std::string& session_id) override;
  // Send() and SendMasks() of the stream block while HTTP/2 flow control applies. A request larger than
  // max_message_bytes is not sent; the stream delivers a FrameAck or MasksAck with accepted = false instead.
  using MappingService::LoadSession;
  using MappingService::OpenMap;
  absl::StatusOr<std::unique_ptr<MapStream>> OpenMap(const std::string& session_id,
                                                     const std::string& resume_token) override;
  absl::StatusOr<std::unique_ptr<EventStream>> Watch(const std::string& session_id) override;
  absl::StatusOr<MapSnapshot> ExportMap(const std::string& session_id) override;
  absl::Status SaveSession(const std::string& session_id, const PieceWriter& write) override;
  absl::StatusOr<SessionInfo> LoadSession(const PieceReader& read, const std::string& tenant) override;
  absl::StatusOr<SessionInfo> PinSession(const std::string& session_id, bool pinned) override;

 private:
  struct Connection;
  explicit RemoteMappingService(std::unique_ptr<Connection> connection);
  static absl::StatusOr<std::unique_ptr<RemoteMappingService>> ConnectOnce(const std::string& host_port,
                                                                           const RemoteOptions& options);

  std::unique_ptr<Connection> connection_;
};

}  // namespace romap::client
