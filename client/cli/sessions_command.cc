#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "client/cli/command.h"
#include "client/cli/service_options.h"
#include "client/cli/session_file_transfer.h"
#include "common/printable.h"
#include "common/status.h"

namespace romap::cli {
namespace {

struct SessionsOptions {
  ServiceOptions service;
  std::string finish, remove, pin, unpin, save, copy;
  std::string file;  // of `save`
  std::string load;  // path of a file
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

std::string StoredText(const SessionInfo& info) {
  if (!info.durable) return "in memory";
  return fmt::format("{:.1f} MB{}", static_cast<double>(info.stored_bytes) / 1e6, info.pinned ? " pin" : "");
}

absl::Status RunSessions(const SessionsOptions& options) {
  ROMAP_ASSIGN_OR_RETURN(const auto service, options.service.Connect());
  if (!options.finish.empty()) ROMAP_RETURN_IF_ERROR(service->FinishSession(options.finish).status());
  if (!options.remove.empty()) ROMAP_RETURN_IF_ERROR(service->DeleteSession(options.remove));
  if (!options.pin.empty()) ROMAP_RETURN_IF_ERROR(service->PinSession(options.pin, true).status());
  if (!options.unpin.empty()) ROMAP_RETURN_IF_ERROR(service->PinSession(options.unpin, false).status());
  if (!options.save.empty()) {
    ROMAP_RETURN_IF_ERROR(SaveSessionFile(*service, options.save, options.file));
    fmt::print("session {} saved to {}\n", options.save, options.file);
  }
  if (!options.load.empty()) {
    ROMAP_ASSIGN_OR_RETURN(const SessionInfo loaded, LoadSessionFile(*service, options.load));
    fmt::print("{} is session {}\n", options.load, loaded.id);
  }
  if (!options.copy.empty()) {
    ROMAP_ASSIGN_OR_RETURN(const SessionInfo copied, CopySession(*service, options.copy));
    fmt::print("the copy of session {} is session {}\n", options.copy, copied.id);
  }
  ROMAP_ASSIGN_OR_RETURN(const auto sessions, service->ListSessions());
  fmt::print("{:<34} {:<10} {:>9} {:>8} {:>8} {:>9} {:>12} {}\n", "session", "state", "frames", "objects", "training",
             "stream", "stored", "name");
  for (const SessionInfo& info : sessions) {
    fmt::print("{:<34} {:<10} {:>9} {:>8} {:>8} {:>9} {:>12} {}\n", Printable(info.id), StateName(info.state),
               info.statistics.frames_processed, info.statistics.objects, info.statistics.objects_training,
               info.stream_open ? "attached" : "-", StoredText(info), Printable(info.name));
  }
  if (sessions.empty()) fmt::print("(no sessions)\n");
  return absl::OkStatus();
}

}  // namespace

void AddSessionsCommand(CLI::App& app, Command* chosen) {
  auto options = std::make_shared<SessionsOptions>();
  CLI::App* command = app.add_subcommand(
      "sessions", "List the sessions of a server; finish, delete, pin, copy, save or load a session");
  options->service.AddTo(*command, /*offer_local=*/false);
  command->add_option("--finish", options->finish,
                      "ID of a session to finish: accepts no more frames and completes its training");
  command->add_option("--delete", options->remove, "ID of a session to delete with its map");
  command->add_option("--pin", options->pin, "ID of a session that must not be deleted by age or size");
  command->add_option("--unpin", options->unpin, "ID of a session that may be deleted by age or size again");
  command->add_option("--copy", options->copy, "ID of a session to copy, e.g. to continue it in two ways");
  auto* file = command->add_option("--file", options->file, "With --save: the file to write, e.g. kitchen.romap");
  command->add_option("--save", options->save, "ID of a session to save as a file, with its inputs and its map")
      ->needs(file);
  command->add_option("--load", options->load, "A file of --save, whose session is added to the server");
  command->callback([options, chosen] { *chosen = [options] { return RunSessions(*options); }; });
}

}  // namespace romap::cli
