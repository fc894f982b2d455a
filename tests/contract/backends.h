#pragma once

#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "common/mapping_service.h"
#include "server/transport/grpc_server.h"

namespace romap::contract {

// A mapping service that keeps the contract, and how it is reached.
struct Backend {
  std::string name;
  std::function<std::unique_ptr<MappingService>()> make;
  // Whether one frame that shows an instance is enough for an object of its class. A service that really maps needs a
  // real scene for that, which is the business of the integration tests.
  bool objects_from_one_frame = false;
  bool over_grpc = false;

  friend void PrintTo(const Backend& backend, std::ostream* os) { *os << backend.name; }
};

// Every service, each once in process and once over gRPC. A new service is one line in backends.cc.
std::vector<Backend> AllBackends();

// A running backend. Over gRPC it has a server of its own on a free port.
class RunningBackend {
 public:
  explicit RunningBackend(const Backend& backend);

  MappingService& service() { return remote_ ? *remote_ : *local_; }

 private:
  // In the order in which they need each other.
  std::unique_ptr<MappingService> local_;
  std::unique_ptr<transport::GrpcServer> server_;
  std::unique_ptr<MappingService> remote_;
};

}  // namespace romap::contract
