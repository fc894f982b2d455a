// romap-server: serves the mapping service of this process over gRPC until SIGINT or SIGTERM.
// Exit status: 0 stopped as asked, 1 could not run, 2 wrong flags or configuration.

#include <fmt/format.h>
#include <pthread.h>
#include <signal.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/config.h"
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

void SayError(const std::string& message) { fmt::print(stderr, "romap-server: {}\n", message); }

// The flags, or the exit status when there is nothing more to do (help, version, wrong flags).
std::variant<Flags, int> ParseFlags(int argc, char** argv) {
  Flags flags;
  std::string listen_address;
  std::optional<int> threads;
  CLI::App app{"Turns video with instance masks into a live map of objects.", "romap-server"};
  app.add_option("--listen", listen_address, "HOST:PORT to serve on (default 127.0.0.1:50051; port 0: any free one)");
  app.add_option("--config", flags.config_file, "YAML file with the configuration");
  app.add_option("--set", flags.assignments, "section.field=value, overrides the file; may be repeated")
      ->allow_extra_args(false);
  app.add_flag("--dump-config", flags.dump_config, "Print the configuration in effect and exit");
  app.add_option("--log-level", flags.log_level, "Least severity that is logged")
      ->check(CLI::IsMember({"trace", "debug", "info", "warning", "error", "critical", "off"}))
      ->capture_default_str();
  app.add_option("--threads", threads, "Training threads (default: one per core)");
  app.set_version_flag("--version", fmt::format("romap-server {}", Version()));
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& e) {
    return app.exit(e);
  } catch (const CLI::ParseError& e) {
    SayError(fmt::format("{} (romap-server --help lists the flags)", e.what()));
    return kExitUsage;
  }
  if (!listen_address.empty()) flags.assignments.push_back("transport.listen_address=" + listen_address);
  if (threads) flags.assignments.push_back(fmt::format("nerf.training_threads={}", *threads));
  return flags;
}

absl::Status Load(const Flags& flags, ConfigFields fields) {
  if (!flags.config_file.empty()) {
    std::ifstream file(flags.config_file);
    // Opening a folder succeeds, and reading from it then throws.
    if (!file || std::filesystem::is_directory(flags.config_file)) {
      return InvalidArgument("cannot read the configuration file '{}'", flags.config_file);
    }
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    ROMAP_RETURN_IF_ERROR(fields.LoadYaml(text, flags.config_file));
  }
  return fields.Set(flags.assignments);
}

void SetUpLogging(const std::string& level) {
  // Standard output is for what scripts wait for, so the log goes to standard error.
  spdlog::set_default_logger(spdlog::stderr_color_mt("romap-server"));
  spdlog::set_level(spdlog::level::from_str(level));
  transport::RouteGrpcLogToSpdlog();
}

// Signals are taken by WaitForStop() instead of by a handler. Threads inherit this, so it must come before any is made.
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
  // A second one ends a stop that takes too long.
  pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
}

int Main(int argc, char** argv) {
  const std::variant<Flags, int> parsed = ParseFlags(argc, argv);
  if (const int* exit_status = std::get_if<int>(&parsed)) return *exit_status;
  const Flags& flags = std::get<Flags>(parsed);

  Config config;
  if (const absl::Status status = Load(flags, config.Fields()); !status.ok()) {
    SayError(Message(status));
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
    SayError(Message(server.status()));
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
