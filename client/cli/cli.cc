#include <fmt/format.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "client/cli/command.h"
#include "client/cli/interrupt.h"
#include "common/status.h"
#include "common/version.h"

namespace romap::cli {
namespace {

constexpr int kExitFailure = 1, kExitUsage = 2, kExitInterrupted = 130;

int ExitCode(const absl::Status& status) {
  if (status.ok()) return 0;
  switch (status.code()) {
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kNotFound:
      return kExitUsage;
    case absl::StatusCode::kCancelled:
      return kExitInterrupted;
    default:
      return kExitFailure;
  }
}

}  // namespace

int RunCli(int argc, const char* const* argv) {
  CLI::App app{"romap: turns a video with instance masks into a map of objects", "romap"};
  app.require_subcommand(1);
  app.fallthrough();  // --log-level may stand after the command too
  app.set_version_flag("--version", fmt::format("romap {}", Version()));
  std::string log_level = "warning";
  app.add_option("--log-level", log_level, "What to log to stderr")
      ->check(CLI::IsMember({"debug", "info", "warning", "error"}))
      ->capture_default_str();
  Command chosen;
  AddRunCommand(app, &chosen);
  AddReplayCommand(app, &chosen);
  AddEvalCommand(app, &chosen);
  AddBenchCommand(app, &chosen);
  AddSynthCommand(app, &chosen);
  AddExportCommand(app, &chosen);
  AddSessionsCommand(app, &chosen);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);  // --help, --version
    // A word that fits nowhere is the cause, whatever else is missing because of it.
    const std::vector<std::string> unknown = app.remaining(/*recurse=*/true);
    const std::string fault = unknown.empty() ? e.what() : fmt::format("'{}' is not known here", unknown.front());
    fmt::print(stderr, "romap: {} (romap --help says more)\n", fault);
    return kExitUsage;
  }
  spdlog::set_default_logger(spdlog::stderr_color_mt("romap"));
  spdlog::set_level(spdlog::level::from_str(log_level));
  CatchInterrupts();
  const absl::Status status = chosen();
  if (!status.ok()) fmt::print(stderr, "romap: {}\n", Message(status));
  return ExitCode(status);
}

}  // namespace romap::cli
