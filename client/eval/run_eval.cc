#include <algorithm>
#include <filesystem>

#include "client/eval/eval.h"
#include "client/files/objects_yaml.h"

namespace romap::eval {
namespace {

namespace fs = std::filesystem;

bool Exists(const std::string& path) {
  std::error_code error;
  return fs::exists(path, error);
}

// The first path that does not exist; nullopt if all exist.
std::optional<std::string> FirstMissing(const std::vector<std::string>& paths) {
  const auto missing = std::find_if_not(paths.begin(), paths.end(), Exists);
  return missing == paths.end() ? std::nullopt : std::optional(*missing);
}

// Whether SeenFrames can determine the visible surface: the sequence has masks, depth and poses, labels are object ids
// (there is no detections file), and every true surface is named after an object.
bool CanDetermineVisibility(const std::string& sequence_dir) {
  if (FirstMissing({sequence_dir + "/mask.txt", sequence_dir + "/depth.txt", sequence_dir + "/groundtruth.txt",
                    sequence_dir + "/objects.yaml"}) ||
      Exists(sequence_dir + "/detections.csv")) {
    return false;
  }
  const auto objects = files::ReadObjects(sequence_dir + "/objects.yaml");
  if (!objects.ok()) return false;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(sequence_dir + "/gt", error)) {
    const std::string name = entry.path().stem().string();
    if (std::none_of(objects->objects.begin(), objects->objects.end(),
                     [&](const files::ObjectRecord& object) { return object.name == name; })) {
      return false;
    }
  }
  return true;
}

// Stores the result of `evaluate` in `target`, or adds a note with the reason why there is none.
template <class Report, class Evaluate>
void Add(const std::string& what, const std::vector<std::string>& needed, Evaluate evaluate,
         std::optional<Report>* target, std::vector<std::string>* notes) {
  if (const auto missing = FirstMissing(needed)) {
    notes->push_back(fmt::format("{} not measured: {} does not exist", what, *missing));
    return;
  }
  absl::StatusOr<Report> report = evaluate();
  if (report.ok()) {
    *target = *std::move(report);
  } else {
    notes->push_back(fmt::format("{} not measured: {}", what, Message(report.status())));
  }
}

// The verdict on the trajectory. If the true poses are readable, a missing or unusable estimate is WRONG.
std::optional<Verdict> VerdictOf(const absl::StatusOr<TrajectoryReport>& trajectory,
                                 const std::string& true_trajectory) {
  if (trajectory.ok()) return trajectory->verdict;
  if (!files::ReadTum(true_trajectory).ok()) return std::nullopt;
  return Verdict{VerdictLevel::kWrong, {Message(trajectory.status())}};
}

void AddTrajectory(const TrajectoryEvalOptions& options, RunReport* report) {
  if (!Exists(options.ground_truth)) {
    report->notes.push_back(fmt::format("trajectory not measured: {} does not exist", options.ground_truth));
    return;
  }
  absl::StatusOr<TrajectoryReport> trajectory = EvaluateTrajectory(options);
  report->verdict = VerdictOf(trajectory, options.ground_truth);
  if (trajectory.ok()) {
    report->trajectory = *std::move(trajectory);
  } else {
    report->notes.push_back(fmt::format("trajectory not measured: {}", Message(trajectory.status())));
  }
}

}  // namespace

RunReport EvaluateRun(const std::string& out_dir, const std::string& sequence_dir, const MapAlignment& alignment,
                      const std::vector<int64_t>& frames_ns) {
  const bool same_world = alignment.alignment == Alignment::kNone;
  const TrajectoryEvalOptions trajectory{.estimated = out_dir + "/trajectory.txt",
                                         .ground_truth = sequence_dir + "/groundtruth.txt",
                                         .alignment = alignment.alignment,
                                         .frames_ns = frames_ns};
  ObjectsEvalOptions objects;
  objects.predicted_dir = out_dir + "/objects";
  objects.ground_truth_dir = sequence_dir + "/gt";
  objects.alignment = same_world ? Alignment::kNone : Alignment::kSe3;
  objects.dataset_dir = CanDetermineVisibility(sequence_dir) ? sequence_dir : "";
  objects.ignore_inferred = true;
  BoxesEvalOptions boxes;
  boxes.predicted = out_dir + "/cuboids.json";
  boxes.ground_truth = sequence_dir + "/objects.yaml";
  std::vector<std::string> objects_need{objects.predicted_dir, objects.ground_truth_dir};
  std::vector<std::string> boxes_need{boxes.predicted, boxes.ground_truth};
  if (!same_world) {
    objects.trajectory_alignment = boxes.trajectory_alignment = alignment.alignment;
    objects.estimated_trajectory = boxes.estimated_trajectory = trajectory.estimated;
    objects.true_trajectory = boxes.true_trajectory = trajectory.ground_truth;
    for (auto* need : {&objects_need, &boxes_need}) {
      need->insert(need->end(), {trajectory.estimated, trajectory.ground_truth});
    }
  }
  RunReport report{.alignment = alignment};
  Add(
      "meshes", objects_need, [&] { return EvaluateObjects(objects); }, &report.objects, &report.notes);
  Add(
      "cuboids", boxes_need, [&] { return EvaluateBoxes(boxes); }, &report.boxes, &report.notes);
  AddTrajectory(trajectory, &report);
  return report;
}

}  // namespace romap::eval
