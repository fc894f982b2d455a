#pragma once

#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "common/mapping_service.h"
#include "server/transport/grpc_server.h"

namespace romap::contract {

// An implementation of MappingService to test, in process or over gRPC.
struct Backend {
  std::string name;
  std::function<std::unique_ptr<MappingService>()> make;
  // Whether one frame with an instance creates an object. False for a real service, which needs frames of a consistent
  // scene (see the integration tests).
  bool objects_from_one_frame = false;
  bool over_grpc = false;
  bool stores_sessions = false;

  friend void PrintTo(const Backend& backend, std::ostream* os) { *os << backend.name; }
};

// Every service, in process and over gRPC.
std::vector<Backend> AllBackends();

// A running backend; over gRPC with its own server on a free port.
class RunningBackend {
 public:
  explicit RunningBackend(const Backend& backend);

  MappingService& service() { return remote_ ? *remote_ : *local_; }

 private:
  // Each member uses the previous one, so the order matters for destruction.
  std::unique_ptr<MappingService> local_;
  std::unique_ptr<transport::GrpcServer> server_;
  std::unique_ptr<MappingService> remote_;
};

}  // namespace romap::contract
