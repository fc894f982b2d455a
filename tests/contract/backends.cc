#include "tests/contract/backends.h"

#include <stdexcept>

#include "client/sdk/remote_mapping_service.h"
#include "common/status.h"
#include "server/session/local_mapping_service.h"
#include "server/store/store.h"
#include "tests/support/fake_mapping_service.h"
#include "tests/support/subprocess.h"

namespace romap::contract {
namespace {

template <class T>
T Must(absl::StatusOr<T> result) {
  if (!result.ok()) throw std::runtime_error(Message(result.status()));
  return std::move(result).value();
}

struct Folder {
  testing_support::TemporaryFolder folder;
};

std::unique_ptr<store::Store> OpenStore(const std::string& path) {
  store::StoreConfig config;
  config.data_dir = path;
  return Must(store::Store::Open(config));
}

session::ServerConfig OneThread() {
  session::ServerConfig config;
  config.training_threads = 1;
  return config;
}

// A service with a store in a folder of its own.
class StoringService : private Folder, public session::LocalMappingService {
 public:
  StoringService() : LocalMappingService(OneThread(), OpenStore(folder.path())) {}
};

}  // namespace

std::vector<Backend> AllBackends() {
  const std::vector<Backend> in_process = {
      {"Fake", [] { return std::make_unique<testing_support::FakeMappingService>(); }, /*objects_from_one_frame=*/true},
      {"Local", [] { return std::make_unique<session::LocalMappingService>(OneThread()); }},
      {.name = "Storing", .make = [] { return std::make_unique<StoringService>(); }, .stores_sessions = true},
  };
  std::vector<Backend> all;
  for (const Backend& backend : in_process) {
    all.push_back(backend);
    all.push_back(backend);
    all.back().name += "OverGrpc";
    all.back().over_grpc = true;
  }
  return all;
}

RunningBackend::RunningBackend(const Backend& backend) : local_(backend.make()) {
  if (!backend.over_grpc) return;
  transport::TransportConfig config;
  config.listen_address = "127.0.0.1:0";
  server_ = Must(transport::GrpcServer::Start(local_.get(), config));
  remote_ = Must(client::RemoteMappingService::Connect(server_->address()));
}

}  // namespace romap::contract
