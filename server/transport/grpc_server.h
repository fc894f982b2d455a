#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "common/mapping_service.h"
#include "server/access/authenticator.h"
#include "server/transport/transport_config.h"

namespace romap::transport {

// Serves a MappingService over gRPC (proto/romap/v1/mapping.proto), with the standard health service (overall and for
// "romap.v1.Mapping") and server reflection. Calls the service from many threads.
class GrpcServer {
 public:
  // `service` outlives the server. INVALID_ARGUMENT: listen_address is not HOST:PORT, or a TLS file is not what it must
  // be. Otherwise as FileError() for a TLS file. UNAVAILABLE: cannot listen there,
  // e.g. because another process does.
  // Everybody may do everything.
  static absl::StatusOr<std::unique_ptr<GrpcServer>> Start(MappingService* service, const TransportConfig& config);
  // Every call is made by the caller that the authenticator finds. It outlives the server.
  static absl::StatusOr<std::unique_ptr<GrpcServer>> Start(const access::Authenticator* authenticator,
                                                           const TransportConfig& config);

  ~GrpcServer();  // Shutdown()

  int port() const;                    // the chosen port if the configuration has port 0
  const std::string& address() const;  // HOST:PORT with port()
  int OpenConnections() const;

  // Rejects new calls, ends the streams with UNAVAILABLE (accepted inputs stay in the service) and waits for all calls.
  // A second call has no effect. Must not be called on the thread of a call.
  void Shutdown();

 private:
  class Impl;
  explicit GrpcServer(std::unique_ptr<Impl> impl);

  std::unique_ptr<Impl> impl_;
};

// Whether the TLS files of the configuration can be used; OK if it has none. Errors as GrpcServer::Start().
absl::Status CheckTlsFiles(const TransportConfig& config);

// Redirects the logs of gRPC and protobuf from stderr to spdlog at debug level, for the whole process.
void RouteGrpcLogToSpdlog();

}  // namespace romap::transport
