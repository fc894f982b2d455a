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

}  // namespace

RunReport EvaluateRun(const std::string& out_dir, const std::string& sequence_dir, bool poses_given) {
  const std::string trajectory = out_dir + "/trajectory.txt";
  const std::string true_trajectory = sequence_dir + "/groundtruth.txt";
  ObjectsEvalOptions objects;
  objects.predicted_dir = out_dir + "/objects";
  objects.ground_truth_dir = sequence_dir + "/gt";
  objects.alignment = poses_given ? Alignment::kNone : Alignment::kSe3;
  objects.dataset_dir = CanDetermineVisibility(sequence_dir) ? sequence_dir : "";
  objects.no_cap = true;
  BoxesEvalOptions boxes;
  boxes.predicted = out_dir + "/cuboids.json";
  boxes.ground_truth = sequence_dir + "/objects.yaml";
  std::vector<std::string> objects_need{objects.predicted_dir, objects.ground_truth_dir};
  std::vector<std::string> boxes_need{boxes.predicted, boxes.ground_truth};
  if (!poses_given) {
    objects.estimated_trajectory = boxes.estimated_trajectory = trajectory;
    objects.true_trajectory = boxes.true_trajectory = true_trajectory;
    for (auto* need : {&objects_need, &boxes_need}) need->insert(need->end(), {trajectory, true_trajectory});
  }
  RunReport report;
  Add(
      "meshes", objects_need, [&] { return EvaluateObjects(objects); }, &report.objects, &report.notes);
  Add(
      "cuboids", boxes_need, [&] { return EvaluateBoxes(boxes); }, &report.boxes, &report.notes);
  Add(
      "trajectory", {trajectory, true_trajectory},
      [&] {
        return EvaluateTrajectory({.estimated = trajectory,
                                   .ground_truth = true_trajectory,
                                   .alignment = poses_given ? Alignment::kNone : Alignment::kSim3});
      },
      &report.trajectory, &report.notes);
  return report;
}

}  // namespace romap::eval
