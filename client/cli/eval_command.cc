#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "client/cli/command.h"
#include "client/eval/eval.h"
#include "common/status.h"

namespace romap::cli {
namespace {

const std::map<std::string, eval::Alignment> kAlignments = {
    {"none", eval::Alignment::kNone}, {"se3", eval::Alignment::kSe3}, {"sim3", eval::Alignment::kSim3}};

// Prints the table, and writes the figures as JSON where asked.
template <class Report>
absl::Status Show(const absl::StatusOr<Report>& report, const std::string& json_path) {
  if (!report.ok()) return report.status();
  fmt::print("{}", eval::FormatTable(*report));
  if (json_path.empty()) return absl::OkStatus();
  std::ofstream file(json_path);
  file << ToJson(*report).dump(1) << '\n';
  if (!file) return InvalidArgument("--json {}: cannot be written", json_path);
  return absl::OkStatus();
}

CLI::App* AddPart(CLI::App& app, const char* name, const char* help, std::string* json_path) {
  CLI::App* command = app.add_subcommand(name, help);
  command->add_option("--json", *json_path, "Also write the figures to this file");
  return command;
}

void AddRunPart(CLI::App& app, Command* chosen) {
  struct Options {
    std::string out, sequence, json;
    bool poses_estimated = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = AddPart(app, "map", "A whole map, as romap run wrote it, against its sequence", &options->json);
  command->add_option("map", options->out, "Folder that romap run wrote")->required();
  command->add_option("sequence", options->sequence, "Folder of the sequence")->required();
  command->add_flag("--poses-estimated", options->poses_estimated,
                    "The camera was tracked: align by the trajectories, then each mesh by ICP");
  command->callback([options, chosen] {
    *chosen = [options] {
      const eval::RunReport report = eval::EvaluateRun(options->out, options->sequence, !options->poses_estimated);
      if (!report.objects && !report.boxes && !report.trajectory) {
        return NotFound("nothing to compare: {}", fmt::join(report.notes, "; "));
      }
      return Show(absl::StatusOr<eval::RunReport>(report), options->json);
    };
  });
}

void AddObjectsPart(CLI::App& app, Command* chosen) {
  struct Options {
    eval::ObjectsEvalOptions eval;
    std::string json;
  };
  auto options = std::make_shared<Options>();
  eval::ObjectsEvalOptions& eval = options->eval;
  CLI::App* command = AddPart(app, "objects", "Accuracy, completion and completion ratio of meshes", &options->json);
  command->add_option("--pred", eval.predicted_dir, "Folder of meshes")->required();
  command->add_option("--gt", eval.ground_truth_dir, "Folder of true surfaces")->required();
  command->add_option("--align", eval.alignment, "Per-object ICP: none, se3 or sim3 (default)")
      ->transform(CLI::CheckedTransformer(kAlignments));
  command->add_option("--threshold-cm", eval.thresholds_cm, "Thresholds of the completion ratio [cm]");
  command->add_option("--est-traj", eval.estimated_trajectory, "Estimated trajectory that places the meshes");
  command->add_option("--gt-traj", eval.true_trajectory, "True trajectory");
  command->add_option("--dataset", eval.dataset_dir, "Sequence that tells which predicted points a camera saw");
  command->add_flag("--no-cap", eval.no_cap, "Leave out the inferred undersides");
  command->add_option("--samples", eval.samples, "Points per mesh")->capture_default_str();
  command->callback(
      [options, chosen] { *chosen = [options] { return Show(eval::EvaluateObjects(options->eval), options->json); }; });
}

void AddBoxesPart(CLI::App& app, Command* chosen) {
  struct Options {
    eval::BoxesEvalOptions eval;
    std::string json;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = AddPart(app, "boxes", "3D IoU, centre and yaw of cuboids", &options->json);
  command->add_option("--pred", options->eval.predicted, "cuboids.json")->required();
  command->add_option("--gt", options->eval.ground_truth, "objects.yaml")->required();
  command->add_option("--est-traj", options->eval.estimated_trajectory, "Estimated trajectory that places the cuboids");
  command->add_option("--gt-traj", options->eval.true_trajectory, "True trajectory");
  command->callback(
      [options, chosen] { *chosen = [options] { return Show(eval::EvaluateBoxes(options->eval), options->json); }; });
}

void AddTrajectoryPart(CLI::App& app, Command* chosen) {
  struct Options {
    eval::TrajectoryEvalOptions eval;
    std::string json;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = AddPart(app, "trajectory", "Absolute trajectory error", &options->json);
  command->add_option("--est", options->eval.estimated, "Estimated trajectory, TUM format")->required();
  command->add_option("--gt", options->eval.ground_truth, "True trajectory, TUM format")->required();
  command->add_option("--align", options->eval.alignment, "none, se3 or sim3 (default)")
      ->transform(CLI::CheckedTransformer(kAlignments));
  command->callback([options, chosen] {
    *chosen = [options] { return Show(eval::EvaluateTrajectory(options->eval), options->json); };
  });
}

}  // namespace

void AddEvalCommand(CLI::App& app, Command* chosen) {
  CLI::App* command = app.add_subcommand("eval", "Compare a map, meshes, cuboids or a trajectory with ground truth");
  command->require_subcommand(1);
  AddRunPart(*command, chosen);
  AddObjectsPart(*command, chosen);
  AddBoxesPart(*command, chosen);
  AddTrajectoryPart(*command, chosen);
}

}  // namespace romap::cli
