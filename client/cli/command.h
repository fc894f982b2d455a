#pragma once

#include <absl/status/status.h>

#include <functional>

namespace CLI {
class App;
}

namespace romap::cli {

// Each command adds itself to the command line; when it is the chosen one, it puts what to do into `chosen`.
using Command = std::function<absl::Status()>;

void AddRunCommand(CLI::App& app, Command* chosen);
void AddBenchCommand(CLI::App& app, Command* chosen);
void AddEvalCommand(CLI::App& app, Command* chosen);
void AddReplayCommand(CLI::App& app, Command* chosen);
void AddSynthCommand(CLI::App& app, Command* chosen);
void AddExportCommand(CLI::App& app, Command* chosen);
void AddSessionsCommand(CLI::App& app, Command* chosen);

// The whole program: parses, runs, prints one line on failure. Exit code: 0 done, 2 the command line or the input is
// wrong, 1 anything else, 130 interrupted.
int RunCli(int argc, const char* const* argv);

}  // namespace romap::cli
