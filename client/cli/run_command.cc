#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "client/cli/command.h"
#include "client/cli/map_exports.h"
#include "client/cli/map_files.h"
#include "client/cli/map_pictures.h"
#include "client/cli/run_stream.h"
#include "client/cli/run_summary.h"
#include "client/cli/sequence_arguments.h"
#include "client/cli/service_options.h"
#include "client/cli/texture_fidelity.h"
#include "client/eval/eval.h"
#include "client/eval/run_record.h"
#include "client/files/pose_uncertainty_file.h"
#include "client/files/text_file.h"
#include "common/status.h"

namespace romap::cli {
namespace {

namespace fs = std::filesystem;

struct RunOptions {
  SequenceArguments sequence;
  std::string out;
  StreamOptions stream;
  ServiceOptions service;
  MapFileOptions map_files;
  bool no_pictures = false;
  bool keep_session = false;  // do not delete the session from the server
  int64_t permute_labels_seed = -1;
};

absl::Status PrepareOutput(const std::string& out) {
  ROMAP_RETURN_IF_ERROR(files::MakeFolder((fs::path(out) / "objects").string()));
  return files::MakeFolder((fs::path(out) / "pictures").string());
}

std::vector<ObjectSnapshot> ToSnapshots(const MapCollector& collector) {
  std::vector<ObjectSnapshot> snapshots;
  for (const auto& [id, snapshot] : collector.objects()) snapshots.push_back(snapshot);
  return snapshots;
}

// What the run used; `romap eval map` reads it from summary.json.
eval::RunRecord RecordOf(const RunOptions& options, const StreamResult& result, const MapCollector& collector) {
  eval::RunRecord record{.first_frame = result.first_frame,
                         .frames_sent = result.frames_before + collector.sent(),
                         .skipped_frames = result.skipped_frames};
  record.poses = "none";  // also if no frame has a pose
  if (collector.sent_with_pose() > 0 && options.sequence.poses != PoseUse::kIgnore) {
    record.poses = options.sequence.poses == PoseUse::kGiven ? "given" : "prior";
  }
  return record;
}

// Compares the map with the ground truth of the sequence, if any, prints the results and adds them to the summary. A
// run that estimated the poses gets a verdict on its trajectory even if it mapped no object.
void Evaluate(const RunOptions& options, const eval::RunRecord& record, const files::Sequence& sequence,
              nlohmann::json& summary) {
  const eval::RunReport report = eval::EvaluateRun(options.out, options.sequence.dir,
                                                   eval::DetermineAlignment(record, options.out, options.sequence.dir),
                                                   eval::FramesOf(record, sequence));
  summary["poses"] = *record.poses;
  summary["frames"]["first"] = *record.first_frame;
  summary["evaluation"] = ToJson(report);
  const bool has_true_objects = report.objects || report.boxes;
  const std::string text = has_true_objects           ? eval::FormatTable(report)
                           : *record.poses == "given" ? ""
                                                      : eval::FormatTrajectory(report);
  if (!text.empty()) fmt::print("\ncomparison with the ground truth of {}:\n{}", options.sequence.dir, text);
}

// Compares the meshes with the frames that were held out. They need poses in the world of the map.
void CompareTextures(const RunOptions& options, const files::Sequence& sequence, const std::vector<MapObject>& objects,
                     nlohmann::json& summary) {
  if (options.stream.hold_out == 0) return;
  if (options.stream.pose_use != PoseUse::kGiven) {
    fmt::print("colors of the meshes not measured: --hold-out needs --poses given\n");
    return;
  }
  const std::vector<size_t> frames = HeldOutFrames(sequence, options.stream);
  const std::vector<TextureFidelity> textures = MeasureTextures(objects, sequence, frames);
  const std::optional<double> mean_db = MeanPsnr_db(textures);
  nlohmann::json list = nlohmann::json::array();
  std::string text;
  for (const TextureFidelity& texture : textures) {
    list.push_back({{"name", texture.object},
                    {"psnr_db", texture.psnr_db},
                    {"frames", texture.frames},
                    {"pixels", texture.pixels}});
    text += fmt::format("{}{} {:.1f}", text.empty() ? "" : ", ", texture.object, texture.psnr_db);
  }
  summary["textures"] = {{"mean_psnr_db", mean_db ? nlohmann::json(*mean_db) : nullptr}, {"objects", list}};
  if (!mean_db) {
    fmt::print("colors of the meshes not measured: no object is visible in the {} frames held out\n", frames.size());
    return;
  }
  fmt::print("colors of the meshes in {} frames held out: PSNR {:.1f} dB (mean of {})\n", frames.size(), *mean_db,
             text);
}

std::string WhereSessionIs(const StreamResult& result) {
  if (result.durable) {
    return fmt::format("session {0} is stored on the server; get its map with: romap export {0}", result.session_id);
  }
  return fmt::format("session {0} is in the memory of the server while that runs; get its map with: romap export {0}",
                     result.session_id);
}

bool KeepsSession(const RunOptions& options, const StreamResult& result) {
  return options.keep_session || options.stream.leave_open || !options.stream.session_id.empty() || !result.status.ok();
}

absl::Status SaveMap(const RunOptions& options, const files::Sequence& sequence, const MapCollector& collector,
                     const StreamResult& result) {
  std::vector<std::string> faults;
  const std::vector<MapObject> objects = DecodeObjects(ToSnapshots(collector), &faults);
  const std::vector<files::StampedPose> trajectory = result.trajectory.value_or(collector.Trajectory());
  ROMAP_RETURN_IF_ERROR(WriteMapFiles(options.out, objects, options.map_files));
  ROMAP_RETURN_IF_ERROR(WriteExports(options.out, options.map_files.formats, objects, trajectory, &sequence));
  ROMAP_RETURN_IF_ERROR(files::WriteTrajectory((fs::path(options.out) / "trajectory.txt").string(), trajectory));
  RunSummary summary = Summarize(sequence, result, collector, objects);
  summary.faults.insert(summary.faults.end(), faults.begin(), faults.end());
  if (!result.status.ok()) summary.faults.push_back("the run is not complete: " + Message(result.status));
  if (!options.no_pictures) ROMAP_RETURN_IF_ERROR(WriteMapPictures(options.out, sequence, trajectory, objects));

  fmt::print("{}", FormatSummary(summary));
  nlohmann::json json = ToJson(summary);
  if (KeepsSession(options, result)) json["session"] = result.session_id;
  Evaluate(options, RecordOf(options, result, collector), sequence, json);
  CompareTextures(options, sequence, objects, json);
  ROMAP_RETURN_IF_ERROR(files::WriteFile((fs::path(options.out) / "summary.json").string(), json.dump(1) + "\n"));
  fmt::print("\nmeshes: {0}/objects/*.ply and *.glb\nimages: {0}/pictures\nsummary: {0}/summary.json\n", options.out);
  return absl::OkStatus();
}

absl::Status RunSequence(RunOptions options) {
  if (options.permute_labels_seed >= 0) options.sequence.read.files.permute_labels_seed = options.permute_labels_seed;
  ROMAP_ASSIGN_OR_RETURN(const files::Sequence sequence, options.sequence.Open());
  options.sequence.SetPoseUse(sequence, &options.stream);
  ROMAP_RETURN_IF_ERROR(PrepareOutput(options.out));
  ROMAP_ASSIGN_OR_RETURN(const auto service, options.service.Connect());

  MapCollector collector;
  ROMAP_ASSIGN_OR_RETURN(const StreamResult result, StreamSequence(sequence, *service, options.stream, collector));
  const absl::Status saved = SaveMap(options, sequence, collector, result);
  if (!saved.ok()) return absl::Status(saved.code(), fmt::format("{} ({})", Message(saved), WhereSessionIs(result)));
  if (!result.status.ok()) {
    return absl::Status(result.status.code(),
                        fmt::format("{} (wrote the partial map; {})", Message(result.status), WhereSessionIs(result)));
  }
  if (options.stream.leave_open) {
    fmt::print("session {0} is open: continue it with --session {0}\n", result.session_id);
  } else if (KeepsSession(options, result)) {
    fmt::print("session {} remains on the server\n", result.session_id);
  } else {
    // The map is saved; a failed deletion does not affect it.
    service->DeleteSession(result.session_id).IgnoreError();
  }
  if (collector.acknowledged() > 0 && collector.rejected() == collector.acknowledged()) {
    return InvalidArgument("all frames of {} were rejected; first error: {}", options.sequence.dir,
                           collector.faults().empty() ? "" : collector.faults().front());
  }
  return absl::OkStatus();
}

// The options that simulate another detector.
void AddDetectorOptions(RunOptions* options, CLI::App* command) {
  command
      ->add_option("--mask-rate", options->stream.mask_rate_hz,
                   "Maximum rate of frames with masks [Hz], simulating a slow detector; 0 = unlimited")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command
      ->add_option("--mask-delay", options->stream.mask_delay_s,
                   "Delay of the masks relative to their frame [s of frame timestamps], simulating a detector delay; "
                   "the server accepts masks up to objects.max_mask_delay_s late")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command
      ->add_option("--permute-labels", options->permute_labels_seed,
                   "Permute the labels at random in each frame with this seed, simulating a detector without a tracker")
      ->check(CLI::NonNegativeNumber);
}

}  // namespace

void AddRunCommand(CLI::App& app, Command* chosen) {
  auto options = std::make_shared<RunOptions>();
  CLI::App* command = app.add_subcommand("run", "Map a recorded sequence and write the map to files");
  command->add_option("--out", options->out, "Output folder for meshes, cuboids, trajectory, images and summary")
      ->required();
  options->service.AddTo(*command, /*offer_local=*/true);
  options->sequence.AddSourceTo(*command);
  options->sequence.AddUseTo(*command);
  AddDetectorOptions(options.get(), command);
  command->add_flag("--realtime", options->stream.realtime,
                    "Send frames at the recorded rate; the server drops frames when overloaded");
  command->add_option("--first", options->stream.first_frame, "Index of the first frame to send");
  command->add_option("--frames", options->stream.frame_count, "Maximum number of frames to send")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--max-training", options->stream.max_training_s,
                   "Maximum wait for training after the last frame [s]")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command
      ->add_option("--hold-out", options->stream.hold_out,
                   "Do not send every N-th frame, and compare the colors of the meshes with these frames; 0 = send all")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--name", options->stream.session_name, "Display name of the session");
  command->add_flag("--keep-session", options->keep_session, "Do not delete the session from the server");
  command->add_option("--session", options->stream.session_id,
                      "ID of an open session to continue, with the frames that it does not have yet");
  command->add_flag("--leave-open", options->stream.leave_open,
                    "Do not finish the session, so that it can be continued with --session");
  command->add_flag("--no-pictures", options->no_pictures, "Do not write images");
  options->map_files.AddTo(*command);
  command->callback([options, chosen] {
    options->stream.resume = !options->service.local;
    *chosen = [options] { return RunSequence(*options); };
  });
}

}  // namespace romap::cli
