#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "common/mapping_service.h"
#include "server/transport/transport_config.h"

namespace romap::transport {

// Serves a MappingService over gRPC (proto/romap/v1/mapping.proto), with the standard health service (overall and as
// "romap.v1.Mapping") and server reflection. Calls of the service come from many threads at once.
class GrpcServer {
 public:
  // `service` outlives the server. INVALID_ARGUMENT: listen_address is not HOST:PORT. UNAVAILABLE: it cannot be
  // listened on, e.g. because another server does.
  static absl::StatusOr<std::unique_ptr<GrpcServer>> Start(MappingService* service, const TransportConfig& config);

  ~GrpcServer();  // Shutdown()

  int port() const;                    // the actual one
  const std::string& address() const;  // HOST:PORT with the actual port

  // Takes no more calls, ends the streams with UNAVAILABLE (what they accepted stays with the service) and waits until
  // all calls are over. May be called again, then does nothing. Not from a thread of a call.
  void Shutdown();

 private:
  class Impl;
  explicit GrpcServer(std::unique_ptr<Impl> impl);

  std::unique_ptr<Impl> impl_;
};

// Sends gRPC's own log, which goes to stderr unasked, to spdlog at debug level. For main(): it holds for the process.
void RouteGrpcLogToSpdlog();

}  // namespace romap::transport
