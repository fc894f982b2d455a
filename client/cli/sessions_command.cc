#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "client/cli/command.h"
#include "client/cli/service_options.h"
#include "common/status.h"

namespace romap::cli {
namespace {

struct SessionsOptions {
  ServiceOptions service;
  std::string finish;
  std::string remove;
};

const char* StateName(SessionState state) {
  switch (state) {
    case SessionState::kOpen:
      return "open";
    case SessionState::kFinishing:
      return "finishing";
    case SessionState::kFinished:
      return "finished";
    case SessionState::kFailed:
      return "failed";
    case SessionState::kRestoring:
      return "restoring";
  }
  return "?";
}

absl::Status RunSessions(const SessionsOptions& options) {
  ROMAP_ASSIGN_OR_RETURN(const auto service, options.service.Connect());
  if (!options.finish.empty()) ROMAP_RETURN_IF_ERROR(service->FinishSession(options.finish).status());
  if (!options.remove.empty()) ROMAP_RETURN_IF_ERROR(service->DeleteSession(options.remove));
  ROMAP_ASSIGN_OR_RETURN(const auto sessions, service->ListSessions());
  fmt::print("{:<14} {:<10} {:>9} {:>8} {:>8} {:>9} {}\n", "session", "state", "frames", "objects", "training",
             "stream", "name");
  for (const SessionInfo& info : sessions) {
    fmt::print("{:<14} {:<10} {:>9} {:>8} {:>8} {:>9} {}\n", info.id, StateName(info.state),
               info.statistics.frames_processed, info.statistics.objects, info.statistics.objects_training,
               info.stream_open ? "attached" : "-", info.name);
  }
  if (sessions.empty()) fmt::print("(no sessions)\n");
  return absl::OkStatus();
}

}  // namespace

void AddSessionsCommand(CLI::App& app, Command* chosen) {
  auto options = std::make_shared<SessionsOptions>();
  CLI::App* command = app.add_subcommand("sessions", "List the sessions of a server; finish or delete a session");
  options->service.AddTo(*command, /*offer_local=*/false);
  command->add_option("--finish", options->finish,
                      "ID of a session to finish: accepts no more frames and completes its training");
  command->add_option("--delete", options->remove, "ID of a session to delete with its map");
  command->callback([options, chosen] { *chosen = [options] { return RunSessions(*options); }; });
}

}  // namespace romap::cli
