// romap-server: serves the mapping service of this process over gRPC until SIGINT or SIGTERM.
// Exit status: 0 after SIGINT or SIGTERM, 1 server could not start, 2 invalid flags or configuration.

#include <fmt/format.h>
#include <pthread.h>
#include <signal.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/config.h"
#include "common/file_status.h"
#include "common/status.h"
#include "common/version.h"
#include "server/session/local_mapping_service.h"
#include "server/session/server_config.h"
#include "server/transport/grpc_server.h"
#include "server/transport/transport_config.h"

namespace romap {
namespace {

constexpr int kExitFailure = 1;
constexpr int kExitUsage = 2;

struct Flags {
  std::string config_file;
  std::vector<std::string> assignments;  // section.field=value, in the order they take effect
  std::string log_level = "info";
  bool dump_config = false;
};

struct Config {
  session::ServerConfig server;
  transport::TransportConfig transport;

  ConfigFields Fields() {
    ConfigFields fields;
    fields.Section("transport");
    transport.Fields(fields);
    server.Fields(fields);
    return fields;
  }
};

void PrintError(const std::string& message) { fmt::print(stderr, "romap-server: {}\n", message); }

// The flags, or the exit status if the program must end (--help, --version, invalid flags).
std::variant<Flags, int> ParseFlags(int argc, char** argv) {
  Flags flags;
  std::string listen_address;
  std::optional<int> threads;
  CLI::App app{"Turns video with instance masks into a live map of objects.", "romap-server"};
  app.add_option("--listen", listen_address, "HOST:PORT to serve on (default 127.0.0.1:50051; port 0 = any free port)");
  app.add_option("--config", flags.config_file, "YAML file with the configuration");
  app.add_option("--set", flags.assignments, "section.field=value; overrides the file; may be repeated")
      ->allow_extra_args(false);
  app.add_flag("--dump-config", flags.dump_config, "Print the effective configuration and exit");
  app.add_option("--log-level", flags.log_level, "Minimum severity of log messages")
      ->check(CLI::IsMember({"trace", "debug", "info", "warning", "error", "critical", "off"}))
      ->capture_default_str();
  app.add_option("--threads", threads, "Training threads (default: one per core)");
  app.set_version_flag("--version", fmt::format("romap-server {}", Version()));
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& e) {
    return app.exit(e);
  } catch (const CLI::ParseError& e) {
    PrintError(fmt::format("{} (see romap-server --help)", e.what()));
    return kExitUsage;
  }
  if (!listen_address.empty()) flags.assignments.push_back("transport.listen_address=" + listen_address);
  if (threads) flags.assignments.push_back(fmt::format("nerf.training_threads={}", *threads));
  return flags;
}

absl::Status Load(const Flags& flags, ConfigFields fields) {
  if (!flags.config_file.empty()) {
    errno = 0;
    std::ifstream file(flags.config_file);
    if (!file) return FileError(flags.config_file, "read the configuration");
    // A folder can be opened like a file, but reading from it throws.
    if (std::filesystem::is_directory(flags.config_file)) {
      return FileError(flags.config_file, "read the configuration", EISDIR);
    }
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    ROMAP_RETURN_IF_ERROR(fields.LoadYaml(text, flags.config_file));
  }
  return fields.Set(flags.assignments);
}

void SetUpLogging(const std::string& level) {
  // To standard error: scripts read the address of the server from standard output.
  spdlog::set_default_logger(spdlog::stderr_color_mt("romap-server"));
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
  if (const absl::Status status = Load(flags, config.Fields()); !status.ok()) {
    PrintError(Message(status));
    return kExitUsage;
  }
  if (flags.dump_config) {
    fmt::print("{}", config.Fields().DumpYaml());
    return 0;
  }

  SetUpLogging(flags.log_level);
  const sigset_t signals = BlockStopSignals();
  session::LocalMappingService service(config.server);
  auto server = transport::GrpcServer::Start(&service, config.transport);
  if (!server.ok()) {
    PrintError(Message(server.status()));
    return absl::IsInvalidArgument(server.status()) ? kExitUsage : kExitFailure;
  }
  fmt::print("romap-server listening on {}\n", (*server)->address());
  std::fflush(stdout);

  WaitForStop(signals);
  (*server)->Shutdown();
  return 0;
}

}  // namespace
}  // namespace romap

int main(int argc, char** argv) { return romap::Main(argc, argv); }
