#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/cli/command.h"
#include "client/eval/eval.h"
#include "client/eval/run_record.h"
#include "client/files/sequence.h"
#include "client/files/text_file.h"
#include "common/status.h"

namespace romap::cli {
namespace {

const std::map<std::string, eval::Alignment> kAlignments = {
    {"none", eval::Alignment::kNone}, {"se3", eval::Alignment::kSe3}, {"sim3", eval::Alignment::kSim3}};

// Prints the report as a table and, if `json_path` is not empty, also writes it as JSON.
template <class Report>
absl::Status Show(const absl::StatusOr<Report>& report, const std::string& json_path) {
  if (!report.ok()) return report.status();
  fmt::print("{}", eval::FormatTable(*report));
  if (json_path.empty()) return absl::OkStatus();
  return files::WriteFile(json_path, ToJson(*report).dump(1) + "\n");
}

CLI::App* AddSubcommand(CLI::App& app, const char* name, const char* help, std::string* json_path) {
  CLI::App* command = app.add_subcommand(name, help);
  command->add_option("--json", *json_path, "Also write the results to this JSON file");
  return command;
}

void AddMapSubcommand(CLI::App& app, Command* chosen) {
  struct Options {
    std::string out, sequence, json;
    std::optional<eval::Alignment> alignment;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = AddSubcommand(app, "map", "Compare the output of romap run with the ground truth of its sequence",
                                    &options->json);
  command->add_option("map", options->out, "Output folder of romap run")->required();
  command->add_option("sequence", options->sequence, "Folder of the sequence")->required();
  command
      ->add_option("--align", options->alignment,
                   "Alignment of the map with the ground truth: none (same world), se3 or sim3 (by the trajectories, "
                   "then each mesh by ICP). Default: none if the run used the given camera poses, otherwise sim3")
      ->transform(CLI::CheckedTransformer(kAlignments))
      ->option_text("none|se3|sim3");
  command->callback([options, chosen] {
    *chosen = [options] {
      const eval::RunRecord record = eval::ReadRunRecord(options->out);
      const eval::MapAlignment alignment = options->alignment
                                               ? eval::MapAlignment{*options->alignment, "--align"}
                                               : eval::DetermineAlignment(record, options->out, options->sequence);
      const absl::StatusOr<files::Sequence> sequence =
          files::Sequence::Open(options->sequence, {.masks = "", .detections = "", .poses = ""});
      const eval::RunReport report =
          eval::EvaluateRun(options->out, options->sequence, alignment,
                            sequence.ok() ? eval::FramesOf(record, *sequence) : std::vector<int64_t>());
      if (!report.objects && !report.boxes && !report.trajectory) {
        return FailedPrecondition("nothing to compare: {}", fmt::join(report.notes, "; "));
      }
      return Show(absl::StatusOr<eval::RunReport>(report), options->json);
    };
  });
}

void AddObjectsSubcommand(CLI::App& app, Command* chosen) {
  struct Options {
    eval::ObjectsEvalOptions eval;
    std::string json;
  };
  auto options = std::make_shared<Options>();
  eval::ObjectsEvalOptions& eval = options->eval;
  CLI::App* command =
      AddSubcommand(app, "objects", "Measure accuracy, completion and completion ratio of meshes", &options->json);
  command->add_option("--pred", eval.predicted_dir, "Folder of predicted meshes")->required();
  command->add_option("--gt", eval.ground_truth_dir, "Folder of ground-truth surfaces")->required();
  command->add_option("--align", eval.alignment, "Alignment of each object by ICP: none, se3 or sim3 (default)")
      ->transform(CLI::CheckedTransformer(kAlignments))
      ->option_text("none|se3|sim3");
  command->add_option("--threshold-cm", eval.thresholds_cm, "Thresholds of the completion ratio [cm]");
  command->add_option("--est-traj", eval.estimated_trajectory,
                      "Estimated trajectory in the coordinate frame of the meshes");
  command->add_option("--gt-traj", eval.true_trajectory, "Ground-truth trajectory");
  command->add_option("--dataset", eval.dataset_dir,
                      "Sequence with masks and depth that determines which predicted points were visible");
  command->add_flag("--ignore-inferred,--no-cap", eval.ignore_inferred,
                    "Ignore ground-truth points that were inferred instead of measured");
  command->add_option("--samples", eval.samples, "Number of samples per mesh")->capture_default_str();
  command->callback(
      [options, chosen] { *chosen = [options] { return Show(eval::EvaluateObjects(options->eval), options->json); }; });
}

void AddBoxesSubcommand(CLI::App& app, Command* chosen) {
  struct Options {
    eval::BoxesEvalOptions eval;
    std::string json;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = AddSubcommand(app, "boxes", "Measure 3D IoU, center and yaw errors of cuboids", &options->json);
  command->add_option("--pred", options->eval.predicted, "Predicted cuboids (cuboids.json)")->required();
  command->add_option("--gt", options->eval.ground_truth, "Ground-truth cuboids (objects.yaml)")->required();
  command->add_option("--est-traj", options->eval.estimated_trajectory,
                      "Estimated trajectory in the coordinate frame of the cuboids");
  command->add_option("--gt-traj", options->eval.true_trajectory, "Ground-truth trajectory");
  command->callback(
      [options, chosen] { *chosen = [options] { return Show(eval::EvaluateBoxes(options->eval), options->json); }; });
}

void AddTrajectorySubcommand(CLI::App& app, Command* chosen) {
  struct Options {
    eval::TrajectoryEvalOptions eval;
    std::string frames_of, json;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = AddSubcommand(
      app, "trajectory", "Measure trajectory errors and print a verdict (GOOD, DEGRADED or WRONG)", &options->json);
  command->add_option("--est", options->eval.estimated, "Estimated trajectory, TUM format")->required();
  command->add_option("--gt", options->eval.ground_truth, "Ground-truth trajectory, TUM format")->required();
  command->add_option("--align", options->eval.alignment, "Alignment of the trajectories: none, se3 or sim3 (default)")
      ->transform(CLI::CheckedTransformer(kAlignments))
      ->option_text("none|se3|sim3");
  command->add_option("--sequence", options->frames_of,
                      "Folder of the sequence, to count its frames without a pose. Default: the number of frames is "
                      "inferred from the poses");
  command->callback([options, chosen] {
    *chosen = [options]() -> absl::Status {
      eval::TrajectoryEvalOptions evaluation = options->eval;
      if (!options->frames_of.empty()) {
        ROMAP_ASSIGN_OR_RETURN(const files::Sequence sequence,
                               files::Sequence::Open(options->frames_of, {.masks = "", .detections = "", .poses = ""}));
        evaluation.frames_ns = eval::FramesOf({.first_frame = 0, .frames_sent = sequence.size()}, sequence);
      }
      return Show(eval::EvaluateTrajectory(evaluation), options->json);
    };
  });
}

}  // namespace

void AddEvalCommand(CLI::App& app, Command* chosen) {
  CLI::App* command = app.add_subcommand("eval", "Compare a map, meshes, cuboids or a trajectory with ground truth");
  command->require_subcommand(1);
  AddMapSubcommand(*command, chosen);
  AddObjectsSubcommand(*command, chosen);
  AddBoxesSubcommand(*command, chosen);
  AddTrajectorySubcommand(*command, chosen);
}

}  // namespace romap::cli
