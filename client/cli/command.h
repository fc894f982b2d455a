#pragma once

#include <absl/status/status.h>

#include <functional>

namespace CLI {
class App;
}

namespace romap::cli {

// The action of a command. Each Add*Command() adds a subcommand to the command line; parsing stores the action of the
// selected one in `chosen`.
using Command = std::function<absl::Status()>;

void AddRunCommand(CLI::App& app, Command* chosen);
void AddBenchCommand(CLI::App& app, Command* chosen);
void AddEvalCommand(CLI::App& app, Command* chosen);
void AddReplayCommand(CLI::App& app, Command* chosen);
void AddSynthCommand(CLI::App& app, Command* chosen);
void AddDoctorCommand(CLI::App& app, Command* chosen);
void AddImportCommand(CLI::App& app, Command* chosen);
void AddExportCommand(CLI::App& app, Command* chosen);
void AddSessionsCommand(CLI::App& app, Command* chosen);

// Runs the program: parses the command line, executes the command, and prints one line to stderr on failure. Returns an
// ExitCode.
int RunCli(int argc, const char* const* argv);

}  // namespace romap::cli
