#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <optional>

#include "client/cli/command.h"
#include "client/cli/map_exports.h"
#include "client/cli/map_files.h"
#include "client/cli/service_options.h"
#include "client/files/pose_uncertainty_file.h"
#include "client/importers/open_recording.h"
#include "common/printable.h"

namespace romap::cli {
namespace {

struct ExportOptions {
  ServiceOptions service;
  std::string session;
  std::string out;
  MapFileOptions map_files;
  std::string sequence;  // the recording; may be empty
};

absl::Status RunExport(const ExportOptions& options) {
  std::optional<files::Sequence> sequence;
  if (!options.sequence.empty()) {
    ROMAP_ASSIGN_OR_RETURN(sequence, importers::OpenRecording(options.sequence));
  }
  ROMAP_ASSIGN_OR_RETURN(const auto service, options.service.Connect());
  ROMAP_ASSIGN_OR_RETURN(const MapSnapshot snapshot, service->ExportMap(options.session));
  std::vector<std::string> faults;
  const std::vector<MapObject> objects = DecodeObjects(snapshot.objects, &faults);
  for (const std::string& fault : faults) fmt::print(stderr, "romap: {}\n", PrintableLines(fault));
  ROMAP_RETURN_IF_ERROR(WriteMapFiles(options.out, objects, options.map_files));

  const std::vector<files::StampedPose> trajectory = TrajectoryOf(snapshot);
  ROMAP_RETURN_IF_ERROR(
      files::WriteTrajectory((std::filesystem::path(options.out) / "trajectory.txt").string(), trajectory));
  ROMAP_RETURN_IF_ERROR(
      WriteExports(options.out, options.map_files.formats, objects, trajectory, sequence ? &*sequence : nullptr));
  fmt::print("{} objects and {} camera poses of session {} written to {}\n", objects.size(), trajectory.size(),
             snapshot.session_id, options.out);
  return absl::OkStatus();
}

}  // namespace

void AddExportCommand(CLI::App& app, Command* chosen) {
  auto options = std::make_shared<ExportOptions>();
  CLI::App* command = app.add_subcommand("export", "Write the current map of a session to files");
  command->add_option("session", options->session, "Session ID (see romap sessions)")->required();
  command->add_option("--out", options->out, "Output folder")->required();
  options->map_files.AddTo(*command);
  command->add_option("--sequence", options->sequence, "The recording that was mapped, for formats with images (--as)");
  options->service.AddTo(*command, /*offer_local=*/false);
  command->callback([options, chosen] { *chosen = [options] { return RunExport(*options); }; });
}

}  // namespace romap::cli
