#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "client/cli/command.h"
#include "client/cli/interrupt.h"
#include "client/cli/map_files.h"
#include "client/cli/progress.h"
#include "client/cli/service_options.h"
#include "client/files/pose_uncertainty_file.h"
#include "client/files/text_file.h"
#include "common/status.h"
#include "common/wire/recording.h"

namespace romap::cli {
namespace {

namespace fs = std::filesystem;

struct ReplayOptions {
  std::string file;
  std::string out;
  bool threads = false;
  ServiceOptions service;
  MapFileOptions map_files;
};

// Sends all records and waits until the map is finished. Discards the events, because the map is exported afterwards.
absl::Status SendRecords(const wire::Recording& recording, MappingService& service, const std::string& session_id) {
  ROMAP_ASSIGN_OR_RETURN(const auto stream, service.OpenMap(session_id));
  Progress progress("replaying");
  for (size_t i = 0; i < recording.size() && !Interrupted(); ++i) {
    ROMAP_ASSIGN_OR_RETURN(SessionInput input, recording.Load(i));
    if (auto* masks = std::get_if<MasksInput>(&input)) {
      ROMAP_RETURN_IF_ERROR(stream->SendMasks(std::move(*masks)));
    } else {
      ROMAP_RETURN_IF_ERROR(stream->Send(std::get<FrameInput>(std::move(input))));
    }
    while (stream->Next(std::chrono::milliseconds(0))) {
    }
    progress.Show(Progress::kFrameFraction * static_cast<double>(i) / static_cast<double>(recording.size()),
                  fmt::format("record {}/{}", i + 1, recording.size()));
  }
  if (Interrupted()) return absl::CancelledError("interrupted; no files were written");
  ROMAP_RETURN_IF_ERROR(service.FinishSession(session_id).status());
  while (!stream->Done() && !Interrupted()) {
    const std::optional<MapEvent> event = stream->Next(std::chrono::milliseconds(50));
    if (const auto* statistics = event ? std::get_if<Statistics>(&*event) : nullptr) {
      progress.Show(Progress::kFrameFraction + (1 - Progress::kFrameFraction) * statistics->training_progress,
                    fmt::format("{} objects in training", statistics->objects_training));
    }
  }
  progress.Done();
  if (Interrupted()) return absl::CancelledError("interrupted; no files were written");
  return stream->status();
}

// Omits times and memory use, so that two replays of the same file write identical bytes.
nlohmann::json ToJson(const wire::Recording& recording, const Statistics& statistics,
                      const std::vector<MapObject>& objects, const std::vector<std::string>& faults) {
  nlohmann::json list = nlohmann::json::array();
  for (const MapObject& entry : objects) {
    list.push_back({{"name", entry.file_stem},
                    {"class", entry.object.class_name},
                    {"observations", entry.object.observations},
                    {"training_steps", entry.steps},
                    {"vertices", entry.mesh.vertices.size()},
                    {"triangles", entry.mesh.triangles.size()}});
  }
  return {{"recording", recording.path()},
          {"lost_bytes", recording.lost_bytes()},
          {"frames",
           {{"sent", statistics.frames_received},
            {"accepted", statistics.frames_processed},
            {"rejected", statistics.frames_rejected},
            {"keyframes", statistics.keyframes}}},
          {"late_masks", recording.size() - recording.frames()},
          {"map_points", statistics.map_points},
          {"objects", list},
          {"faults", faults}};
}

absl::Status WriteResult(const ReplayOptions& options, const wire::Recording& recording, const MapSnapshot& snapshot) {
  std::vector<std::string> faults;
  const std::vector<MapObject> objects = DecodeObjects(snapshot.objects, &faults);
  ROMAP_RETURN_IF_ERROR(WriteMapFiles(options.out, objects, options.map_files));
  ROMAP_RETURN_IF_ERROR(
      files::WriteTrajectory((fs::path(options.out) / "trajectory.txt").string(), TrajectoryOf(snapshot)));
  const nlohmann::json summary = ToJson(recording, snapshot.statistics, objects, faults);
  ROMAP_RETURN_IF_ERROR(files::WriteFile((fs::path(options.out) / "summary.json").string(), summary.dump(1) + "\n"));
  fmt::print("{} frames replayed ({} keyframes): {} objects and {} camera poses written to {}\n", recording.frames(),
             snapshot.statistics.keyframes, objects.size(), snapshot.trajectory.size(), options.out);
  return absl::OkStatus();
}

absl::Status RunReplay(ReplayOptions options) {
  ROMAP_ASSIGN_OR_RETURN(const wire::Recording recording, wire::Recording::Open(options.file));
  if (recording.lost_bytes() > 0) {
    fmt::print(stderr, "romap: {}: the last record is truncated; ignored {} bytes, replaying {} frames\n", options.file,
               recording.lost_bytes(), recording.frames());
  }
  options.service.local = true;
  if (!options.threads) {
    // Inserted first, so that the user's settings take precedence.
    options.service.settings.insert(options.service.settings.begin(),
                                    {"session.single_thread=true", "nerf.training_threads=0"});
  }
  ROMAP_ASSIGN_OR_RETURN(const auto service, options.service.Connect());
  SessionOptions session = recording.options();
  session.mode = FrameMode::kReplay;  // the recording contains no dropped frames
  ROMAP_ASSIGN_OR_RETURN(const SessionInfo info, service->CreateSession(session));
  ROMAP_RETURN_IF_ERROR(SendRecords(recording, *service, info.id));
  ROMAP_ASSIGN_OR_RETURN(const MapSnapshot snapshot, service->ExportMap(info.id));
  return WriteResult(options, recording, snapshot);
}

}  // namespace

void AddReplayCommand(CLI::App& app, Command* chosen) {
  auto options = std::make_shared<ReplayOptions>();
  CLI::App* command =
      app.add_subcommand("replay", "Map a recorded session (session.record_dir) again, with reproducible results");
  command->add_option("file", options->file, "Recording, <session id>.romaprec")->required();
  command->add_option("--out", options->out, "Output folder for meshes, cuboids, trajectory and summary")->required();
  command->add_flag("--threads", options->threads,
                    "Use multiple threads like a server: faster, but results vary slightly between runs");
  options->map_files.AddTo(*command);
  command->add_option("--config", options->service.config_file, "YAML configuration file");
  command->add_option("--set", options->service.settings, "Set a configuration value, section.field=value; repeatable");
  command->callback([options, chosen] { *chosen = [options] { return RunReplay(*options); }; });
}

}  // namespace romap::cli
