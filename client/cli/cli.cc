#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <vector>

#include "client/cli/command.h"
#include "client/cli/interrupt.h"
#include "common/build_info/build_info.h"
#include "common/exit_code.h"
#include "common/log_sink.h"
#include "common/printable.h"
#include "common/status.h"

namespace romap::cli {
int RunCli(int argc, const char* const* argv) {
  // Otherwise gRPC prints every failed attempt to connect. See GRPC_VERBOSITY in its documentation.
  setenv("GRPC_VERBOSITY", "NONE", /*overwrite=*/0);
  CLI::App app{"romap: builds a map of objects from video with instance masks", "romap"};
  app.require_subcommand(1);
  app.fallthrough();  // accept --log-level after the command too
  app.footer(kExitCodeHelp);
  bool verbose = false;
  app.set_version_flag("--version", BuildInfo("romap", HasVerboseFlag(argc, argv)));
  app.add_flag("--verbose", verbose, "With --version: also the versions of the libraries");
  std::string log_level = "warning";
  app.add_option("--log-level", log_level, "Minimum severity of log messages on stderr")
      ->check(CLI::IsMember({"debug", "info", "warning", "error"}))
      ->capture_default_str();
  Command chosen;
  AddRunCommand(app, &chosen);
  AddDoctorCommand(app, &chosen);
  AddImportCommand(app, &chosen);
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
    // An unknown word is the root cause; CLI11 may report an option that is missing as a consequence.
    const std::vector<std::string> unknown = app.remaining(/*recurse=*/true);
    const std::string fault =
        unknown.empty() ? e.what() : fmt::format("unknown command or option '{}'", unknown.front());
    fmt::print(stderr, "romap: {} (see romap --help)\n", fault);
    return kUsageError;
  }
  spdlog::set_default_logger(std::make_shared<spdlog::logger>("romap", MakeLogSink(stderr)));
  spdlog::set_level(spdlog::level::from_str(log_level));
  CatchInterrupts();
  const absl::Status status = chosen();
  if (!status.ok()) fmt::print(stderr, "romap: {}\n", PrintableLines(Message(status)));
  return ToExitCode(status);
}

}  // namespace romap::cli
