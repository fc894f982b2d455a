#include "client/cli/service_options.h"

#include <CLI/CLI.hpp>
#include <cctype>
#include <cstdlib>

#include "client/files/text_file.h"
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
  fields.IgnoreSection("http");
  fields.IgnoreSection("access");
  fields.IgnoreSection("log");
  fields.IgnoreSection("store");
  ROMAP_RETURN_IF_ERROR(fields.Load(options.config_file, options.settings));
  return config;
}

// A file, because other users of the machine see the arguments of a program.
absl::StatusOr<std::string> ReadToken(std::string path) {
  const char* variable = std::getenv("ROMAP_TOKEN_FILE");
  if (path.empty() && variable != nullptr) path = variable;
  if (path.empty()) return std::string();
  ROMAP_ASSIGN_OR_RETURN(std::string token, files::ReadFile(path));
  while (!token.empty() && std::isspace(static_cast<unsigned char>(token.back())) != 0) token.pop_back();
  if (token.empty() || token.find_first_of(" \t\r\n") != std::string::npos) {
    return InvalidArgument("{}: must have one token, as printed by: romap-server token create", path);
  }
  return token;
}

}  // namespace

void ServiceOptions::AddTo(CLI::App& app, bool offer_local) {
  auto* server_option = app.add_option("--server", server, "Address of romap-server, HOST:PORT")->capture_default_str();
  auto* wait = app.add_option("--wait", wait_s, "Wait so long for a server that is not there yet [s]")
                   ->check(CLI::NonNegativeNumber);
  auto* token = app.add_option("--token-file", token_file,
                               "File with the token, for a server that wants one; default: $ROMAP_TOKEN_FILE");
  app.add_flag("--tls", tls, "Connect with TLS; the certificates of the system say which servers are trusted");
  auto* ca =
      app.add_option("--tls-ca", tls_ca, "Connect with TLS to a server whose certificate these signed (PEM file)");
  app.add_option("--tls-server-name", tls_server_name,
                 "Name in the certificate of the server, if it is not its address");
  auto* certificate = app.add_option("--tls-cert", tls_certificate,
                                     "Certificate of this client (PEM file), for a server that wants one");
  app.add_option("--tls-key", tls_key, "Its private key (PEM file)")->needs(certificate);
  if (!offer_local) return;
  auto* local_flag = app.add_flag("--local", local, "Map in this process instead of on a server");
  for (CLI::Option* option : {server_option, wait, token, ca, certificate}) local_flag->excludes(option);
  app.add_option("--config", config_file, "YAML configuration file (with --local)")->needs(local_flag);
  app.add_option("--set", settings, "Set a configuration value, section.field=value (with --local); repeatable")
      ->needs(local_flag);
}

absl::StatusOr<std::unique_ptr<MappingService>> ServiceOptions::Connect() const {
  if (!local) {
    if (server.find(':') == std::string::npos) return InvalidArgument("--server: expected HOST:PORT, got '{}'", server);
    client::RemoteOptions remote_options;
    ROMAP_ASSIGN_OR_RETURN(remote_options.token, ReadToken(token_file));
    remote_options.tls = {.enabled = tls || !tls_ca.empty() || !tls_certificate.empty(),
                          .ca_file = tls_ca,
                          .certificate = tls_certificate,
                          .key_file = tls_key,
                          .server_name = tls_server_name};
    remote_options.wait = std::chrono::milliseconds(static_cast<int64_t>(1000 * wait_s));
    ROMAP_ASSIGN_OR_RETURN(auto remote, client::RemoteMappingService::Connect(server, remote_options));
    return std::unique_ptr<MappingService>(std::move(remote));
  }
  ROMAP_ASSIGN_OR_RETURN(const session::ServerConfig config, LoadConfig(*this));
  return std::unique_ptr<MappingService>(std::make_unique<session::LocalMappingService>(config));
}

}  // namespace romap::cli
