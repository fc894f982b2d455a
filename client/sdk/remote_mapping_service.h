#pragma once

#include <absl/status/statusor.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "common/mapping_service.h"

namespace romap::client {

struct RemoteOptions {
  std::chrono::milliseconds connect_timeout{3000};
  std::chrono::milliseconds call_timeout{30'000};     // of one answer, and of opening a stream
  std::chrono::milliseconds export_timeout{300'000};  // of a whole export
  int max_message_bytes = 32 << 20;                   // as the server's transport.max_message_bytes
};

// The mapping service of a romap-server. Thread-safe. Streams keep the connection and may outlive this object.
//
// The connection is mended by gRPC when it breaks; a stream that was open then ends with UNAVAILABLE, and the session
// lives on at the server, where OpenMap() can take it up again.
// Beyond MappingService's own errors every call may answer UNAVAILABLE (the server is gone) and DEADLINE_EXCEEDED.
class RemoteMappingService : public MappingService {
 public:
  // `host_port`: "127.0.0.1:50051". UNAVAILABLE when no romap-server answers there within the timeout.
  static absl::StatusOr<std::unique_ptr<RemoteMappingService>> Connect(const std::string& host_port,
                                                                       const RemoteOptions& options = {});

  ~RemoteMappingService() override;

  absl::StatusOr<SessionInfo> CreateSession(const SessionOptions& options) override;
  absl::StatusOr<std::vector<SessionInfo>> ListSessions() override;
  absl::StatusOr<SessionInfo> GetSession(const std::string& session_id) override;
  absl::StatusOr<SessionInfo> FinishSession(const std::string& session_id) override;
  absl::Status DeleteSession(const std::string& session_id) override;
  // Send() blocks while HTTP/2 flow control pushes back. A frame whose message is larger than max_message_bytes is
  // answered with a FrameAck{accepted=false} from here.
  absl::StatusOr<std::unique_ptr<MapStream>> OpenMap(const std::string& session_id) override;
  absl::StatusOr<std::unique_ptr<EventStream>> Watch(const std::string& session_id) override;
  absl::StatusOr<MapSnapshot> ExportMap(const std::string& session_id) override;

 private:
  struct Connection;
  explicit RemoteMappingService(std::unique_ptr<Connection> connection);

  std::unique_ptr<Connection> connection_;
};

}  // namespace romap::client
