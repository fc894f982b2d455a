#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/mapping_service.h"

namespace CLI {
class App;
}

namespace romap::cli {

// The options that select the mapping service of a command: a server (default) or this process.
struct ServiceOptions {
  std::string server = "127.0.0.1:50051";
  bool local = false;
  double wait_s = 0;       // for a server that is not there yet
  std::string token_file;  // the token for a server that wants one; also $ROMAP_TOKEN_FILE
  bool tls = false;        // also by tls_ca
  std::string tls_ca, tls_certificate, tls_key, tls_server_name;
  std::string config_file;            // --local only
  std::vector<std::string> settings;  // --local only

  // Adds --server and, with `offer_local`, --local, --config and --set.
  void AddTo(CLI::App& app, bool offer_local);
  // Connects to the server, or creates the service in this process. INVALID_ARGUMENT: malformed address or
  // configuration. UNAVAILABLE: no server responds. Otherwise as ReadFile for --config.
  absl::StatusOr<std::unique_ptr<MappingService>> Connect() const;
};

}  // namespace romap::cli
