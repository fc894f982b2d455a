#include "client/cli/service_options.h"

#include <CLI/CLI.hpp>

#include "client/sdk/remote_mapping_service.h"
#include "common/status.h"
#include "server/session/local_mapping_service.h"

namespace romap::cli {
namespace {

absl::StatusOr<session::ServerConfig> LoadConfig(const ServiceOptions& options) {
  session::ServerConfig config;
  ConfigFields fields;
  config.Fields(fields);
  // The file may also be used by romap-server, which has these additional sections.
  fields.IgnoreSection("transport");
  fields.IgnoreSection("log");
  fields.IgnoreSection("store");
  ROMAP_RETURN_IF_ERROR(fields.Load(options.config_file, options.settings));
  return config;
}

}  // namespace

void ServiceOptions::AddTo(CLI::App& app, bool offer_local) {
  auto* server_option = app.add_option("--server", server, "Address of romap-server, HOST:PORT")->capture_default_str();
  auto* wait = app.add_option("--wait", wait_s, "Wait so long for a server that is not there yet [s]")
                   ->check(CLI::NonNegativeNumber);
  if (!offer_local) return;
  auto* local_flag = app.add_flag("--local", local, "Map in this process instead of on a server");
  local_flag->excludes(server_option)->excludes(wait);
  app.add_option("--config", config_file, "YAML configuration file (with --local)")->needs(local_flag);
  app.add_option("--set", settings, "Set a configuration value, section.field=value (with --local); repeatable")
      ->needs(local_flag);
}

absl::StatusOr<std::unique_ptr<MappingService>> ServiceOptions::Connect() const {
  if (!local) {
    if (server.find(':') == std::string::npos) return InvalidArgument("--server: expected HOST:PORT, got '{}'", server);
    client::RemoteOptions remote_options;
    remote_options.wait = std::chrono::milliseconds(static_cast<int64_t>(1000 * wait_s));
    ROMAP_ASSIGN_OR_RETURN(auto remote, client::RemoteMappingService::Connect(server, remote_options));
    return std::unique_ptr<MappingService>(std::move(remote));
  }
  ROMAP_ASSIGN_OR_RETURN(const session::ServerConfig config, LoadConfig(*this));
  return std::unique_ptr<MappingService>(std::make_unique<session::LocalMappingService>(config));
}

}  // namespace romap::cli
