// romap-server: serves the mapping service of this process over gRPC and HTTP until SIGINT or SIGTERM.
// Exit status: 0 after SIGINT or SIGTERM, 1 server could not start, 2 invalid flags or configuration,
// 3 configuration file cannot be read.

#include <fmt/format.h>
#include <pthread.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/build_info/build_info.h"
#include "common/config.h"
#include "common/exit_code.h"
#include "common/host_port.h"
#include "common/log_sink.h"
#include "common/status.h"
#include "server/access/access_config.h"
#include "server/access/authenticator.h"
#include "server/access/token_command.h"
#include "server/http/http_config.h"
#include "server/http/http_server.h"
#include "server/process/service_manager.h"
#include "server/session/local_mapping_service.h"
#include "server/session/server_config.h"
#include "server/store/store.h"
#include "server/store/store_config.h"
#include "server/transport/grpc_server.h"
#include "server/transport/transport_config.h"

namespace romap {
namespace {

struct Flags {
  std::string config_file;
  std::vector<std::string> assignments;  // section.field=value, in the order they take effect
  bool dump_config = false;
  bool expert = false;
  bool check_config = false;
  bool insecure_network = false;
};

struct Config {
  transport::TransportConfig transport;
  http::HttpConfig http;
  access::AccessConfig access;
  std::string log_level = "info";
  std::string log_format = "text";
  store::StoreConfig store;
  session::ServerConfig server;

  ConfigFields Fields() {
    ConfigFields fields;
    fields.Section("transport");
    transport.Fields(fields);
    fields.Section("http");
    http.Fields(fields);
    fields.Section("access");
    access.Fields(fields);
    fields.Section("log");
    fields.Add("level", &log_level,
               {.choices = {"trace", "debug", "info", "warning", "error", "critical", "off"},
                .audience = Audience::kOperator,
                .help = "Minimum severity of logged messages"});
    fields.Add("format", &log_format,
               {.choices = {"text", "json"}, .help = "json = an object per line, for programs that collect logs"});
    fields.Section("store");
    store.Fields(fields);
    server.Fields(fields);
    return fields;
  }
};

void PrintError(const std::string& message) { fmt::print(stderr, "romap-server: {}\n", message); }

std::string TokenFileOf(const std::string& data_dir) {
  return (data_dir.empty() ? store::DefaultDataDir() : data_dir) + "/tokens.json";
}

// The flags, or the exit status if the program must exit (--help, --version, token commands, invalid flags).
std::variant<Flags, int> ParseFlags(int argc, char** argv) {
  Flags flags;
  std::optional<std::string> listen_address, http_address, log_level, data_dir, tls_certificate, tls_key, tls_client_ca;
  bool ephemeral = false;
  std::optional<int> threads;
  CLI::App app{"Turns video with instance masks into a live map of objects.", "romap-server"};
  app.add_option(
      "--listen", listen_address,
      "HOST:PORT of the gRPC service; port 0 = any free port. Same as --set transport.listen_address=HOST:PORT");
  app.add_option("--http", http_address,
                 "HOST:PORT of the page that shows the maps; \"\" = none. Same as --set http.listen_address=HOST:PORT");
  app.add_option("--data-dir", data_dir,
                 "Folder where sessions are stored; default: $XDG_DATA_HOME/romap or ~/.local/share/romap. Same as "
                 "--set store.data_dir=DIR");
  app.add_flag("--ephemeral", ephemeral,
               "Store nothing: sessions end with the server. Same as --set store.ephemeral=true");
  app.add_option("--tls-cert", tls_certificate,
                 "PEM file with the server's certificate. Same as --set transport.tls_certificate=FILE");
  app.add_option("--tls-key", tls_key, "PEM file with its private key. Same as --set transport.tls_key=FILE");
  app.add_option("--tls-client-ca", tls_client_ca,
                 "PEM file; clients need a certificate signed by one of these. Same as --set "
                 "transport.tls_client_ca=FILE");
  app.add_flag("--insecure-network", flags.insecure_network,
               "Listen beyond this machine without TLS or without tokens: whoever reaches the address can read, change "
               "and delete every session");
  app.add_flag("--check-config", flags.check_config, "Check flags, configuration and TLS files, and exit");
  app.add_option("--config", flags.config_file, "YAML file with settings; see deploy/server.yaml");
  app.add_option("--set", flags.assignments, "SECTION.FIELD=VALUE; overrides the file; may be repeated")
      ->allow_extra_args(false);
  auto* dump = app.add_flag("--dump-config", flags.dump_config,
                            "Print the settings for operators and those that were set, with unit, range and meaning, "
                            "and exit");
  app.add_flag("--expert", flags.expert, "With --dump-config: print all settings")->needs(dump);
  app.add_option("--log-level", log_level, "Minimum severity of logged messages. Same as --set log.level=LEVEL");
  app.add_option("--threads", threads, "Number of training threads. Same as --set nerf.training_threads=N");
  bool verbose = false;
  app.set_version_flag("--version", BuildInfo("romap-server", HasVerboseFlag(argc, argv)));
  app.add_flag("--verbose", verbose, "With --version: also the versions of the libraries");
  access::TokenCommand token_command(&app, TokenFileOf);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& e) {
    return app.exit(e);
  } catch (const CLI::ParseError& e) {
    PrintError(fmt::format("{} (see romap-server --help)", e.what()));
    return kUsageError;
  }
  if (token_command.IsChosen()) return token_command.Run();
  if (tls_certificate) flags.assignments.push_back("transport.tls_certificate=" + *tls_certificate);
  if (tls_key) flags.assignments.push_back("transport.tls_key=" + *tls_key);
  if (tls_client_ca) flags.assignments.push_back("transport.tls_client_ca=" + *tls_client_ca);
  if (listen_address) flags.assignments.push_back("transport.listen_address=" + *listen_address);
  if (http_address) flags.assignments.push_back("http.listen_address=" + *http_address);
  if (data_dir) flags.assignments.push_back("store.data_dir=" + *data_dir);
  if (ephemeral) flags.assignments.push_back("store.ephemeral=true");
  if (log_level) flags.assignments.push_back("log.level=" + *log_level);
  if (threads) flags.assignments.push_back(fmt::format("nerf.training_threads={}", *threads));
  return flags;
}

// Sessions are not offered to a network in which everybody can take them.
absl::Status CheckExposure(const std::string& listen_address, const Config& config, const std::string& token_file,
                           bool is_allowed) {
  const auto address = ParseHostPort(listen_address);
  if (!address || IsLoopback(*address) || is_allowed) return absl::OkStatus();
  const bool has_tls = !config.transport.tls_certificate.empty();
  const bool has_tokens = access::TokenStore(token_file).Exists();
  if (has_tls && has_tokens) return absl::OkStatus();
  return InvalidArgument(
      "{} is reachable from other machines, but {}. Use tokens (romap-server token create) and TLS (--tls-cert, "
      "--tls-key), listen on 127.0.0.1, or accept the risk with --insecure-network",
      listen_address,
      !has_tokens ? "everybody there could read, change and delete every session, because the server has no tokens"
                  : "tokens and images would be sent in clear text, because the server has no TLS");
}

bool WasSet(const ConfigFields& fields, const std::string& name) {
  return std::ranges::any_of(fields.fields(),
                             [&](const ConfigField& field) { return field.name == name && !field.origin.empty(); });
}

// Null: there is none. The default address may belong to another program, which is no reason to map nothing.
absl::StatusOr<std::unique_ptr<http::HttpServer>> StartHttp(const access::Authenticator& authenticator,
                                                            const Config& config, bool address_was_set,
                                                            http::MetricSources metrics) {
  if (config.http.listen_address.empty()) return nullptr;
  auto server = http::HttpServer::Start(
      &authenticator,
      {.config = config.http, .tls = config.transport, .assets = http::ViewerAssets(), .metrics = std::move(metrics)});
  if (server.ok() || address_was_set || !absl::IsUnavailable(server.status())) return server;
  spdlog::warn("there is no page to show the maps: {}. Choose another address with --http HOST:PORT",
               Message(server.status()));
  return nullptr;
}

// Every connection needs a file. 1024, a common default, is few.
void RaiseFileLimit() {
  rlimit files{};
  if (getrlimit(RLIMIT_NOFILE, &files) != 0 || files.rlim_cur >= files.rlim_max) return;
  files.rlim_cur = files.rlim_max;
  setrlimit(RLIMIT_NOFILE, &files);
}

void SetUpLogging(const std::string& level, const std::string& format) {
  // Scripts read the address from standard output, so the log goes to standard error. A reader that ends must not end
  // the server.
  signal(SIGPIPE, SIG_IGN);
  spdlog::set_default_logger(std::make_shared<spdlog::logger>(
      "romap-server", MakeLogSink(stderr, format == "json" ? LogFormat::kJson : LogFormat::kText)));
  spdlog::set_level(spdlog::level::from_str(level));
  transport::RouteGrpcLogToSpdlog();
}

// WaitForStop() receives the signals instead of a handler. Threads inherit the mask, so call this before starting any.
sigset_t BlockStopSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

void WaitForStop(const sigset_t& signals) {
  int signal = 0;
  sigwait(&signals, &signal);
  spdlog::info("stopping on {}", signal == SIGINT ? "SIGINT" : "SIGTERM");
  // A second signal terminates the process if the shutdown takes too long.
  pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
}

int Main(int argc, char** argv) {
  const std::variant<Flags, int> parsed = ParseFlags(argc, argv);
  if (const int* exit_status = std::get_if<int>(&parsed)) return *exit_status;
  const Flags& flags = std::get<Flags>(parsed);

  Config config;
  ConfigFields fields = config.Fields();
  if (const absl::Status status = fields.Load(flags.config_file, flags.assignments); !status.ok()) {
    PrintError(Message(status));
    return ToExitCode(status);
  }
  if (flags.dump_config) {
    fmt::print("{}", fields.DumpYaml(flags.expert ? Audience::kExpert : Audience::kOperator));
    return 0;
  }

  std::string token_file = config.access.token_file;
  if (token_file.empty() && !config.store.ephemeral) token_file = TokenFileOf(config.store.data_dir);
  for (const std::string& address : {config.transport.listen_address, config.http.listen_address}) {
    const absl::Status status = CheckExposure(address, config, token_file, flags.insecure_network);
    if (status.ok()) continue;
    PrintError(Message(status));
    return kUsageError;
  }
  if (flags.check_config) {
    const absl::Status status = transport::CheckTlsFiles(config.transport);
    if (status.ok()) {
      fmt::print("the configuration is valid\n");
      return 0;
    }
    PrintError(Message(status));
    return ToExitCode(status);
  }

  RaiseFileLimit();
  SetUpLogging(config.log_level, config.log_format);
  const sigset_t signals = BlockStopSignals();
  std::unique_ptr<store::Store> store;
  if (!config.store.ephemeral) {
    auto opened = store::Store::Open(config.store);
    if (!opened.ok()) {
      PrintError(Message(opened.status()));
      return kFailure;
    }
    store = *std::move(opened);
  }
  const std::string data_dir = store ? store->path() : "";
  session::LocalMappingService service(config.server, std::move(store));
  const access::Authenticator authenticator(&service, token_file, config.access);
  auto server = transport::GrpcServer::Start(&authenticator, config.transport);
  if (!server.ok()) {
    PrintError(Message(server.status()));
    return absl::IsInvalidArgument(server.status()) ? kUsageError : kFailure;
  }
  auto page = StartHttp(authenticator, config, WasSet(fields, "http.listen_address"),
                        {.service = [&service] { return service.Metrics(); },
                         .grpc_connections = [&server] { return (*server)->OpenConnections(); }});
  if (!page.ok()) {
    PrintError(Message(page.status()));
    return absl::IsInvalidArgument(page.status()) ? kUsageError : kFailure;
  }
  spdlog::info("sessions are {}", data_dir.empty() ? "not stored" : "stored in " + data_dir);
  spdlog::info("{}; {}", config.transport.tls_certificate.empty() ? "no TLS" : "TLS",
               authenticator.NeedsToken() ? "calls need a token" : "calls need no token");
  fmt::print("romap-server listening on {}\n", (*server)->address());
  if (*page) fmt::print("romap-server page at {}\n", (*page)->url());
  std::fflush(stdout);

  // A service that does not answer any more hangs in a lock that all calls need.
  auto manager = std::make_unique<process::ServiceManager>([&service] { service.ListSessions().IgnoreError(); });
  WaitForStop(signals);
  manager.reset();
  if (*page) (*page)->Shutdown();
  (*server)->Shutdown();
  if (service.HasHangingSession()) {
    // Its thread still uses the service.
    service.StoreAll();
    spdlog::error("exiting without waiting for the thread that hangs");
    std::_Exit(kFailure);
  }
  return 0;
}

}  // namespace
}  // namespace romap

int main(int argc, char** argv) { return romap::Main(argc, argv); }
