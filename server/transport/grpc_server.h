#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "common/mapping_service.h"
#include "server/transport/transport_config.h"

namespace romap::transport {

// Serves a MappingService over gRPC (proto/romap/v1/mapping.proto), with the standard health service (overall and for
// "romap.v1.Mapping") and server reflection. Calls the service from many threads.
class GrpcServer {
 public:
  // `service` outlives the server. INVALID_ARGUMENT: listen_address is not HOST:PORT. UNAVAILABLE: cannot listen there,
  // e.g. because another process does.
  static absl::StatusOr<std::unique_ptr<GrpcServer>> Start(MappingService* service, const TransportConfig& config);

  ~GrpcServer();  // Shutdown()

  int port() const;                    // the chosen port if the configuration has port 0
  const std::string& address() const;  // HOST:PORT with port()

  // Rejects new calls, ends the streams with UNAVAILABLE (accepted inputs stay in the service) and waits for all calls.
  // A second call has no effect. Must not be called on the thread of a call.
  void Shutdown();

 private:
  class Impl;
  explicit GrpcServer(std::unique_ptr<Impl> impl);

  std::unique_ptr<Impl> impl_;
};

// Redirects gRPC's log from stderr to spdlog at debug level, for the whole process.
void RouteGrpcLogToSpdlog();

}  // namespace romap::transport
