#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/mapping_service.h"

namespace CLI {
class App;
}

namespace romap::cli {

// Where a command finds its mapping service: a server (the default) or this process.
struct ServiceOptions {
  std::string server = "127.0.0.1:50051";
  bool local = false;
  std::string config_file;            // --local only
  std::vector<std::string> settings;  // --local only

  // Adds --server, and with `offer_local` also --local, --config and --set.
  void AddTo(CLI::App& app, bool offer_local);
  // UNAVAILABLE when no server answers.
  absl::StatusOr<std::unique_ptr<MappingService>> Connect() const;
};

}  // namespace romap::cli
