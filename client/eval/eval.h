#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/eval/boxes_eval.h"
#include "client/eval/objects_eval.h"
#include "client/eval/trajectory_eval.h"

namespace romap::eval {

// The figures of one run against the ground truth of its sequence.
struct RunReport {
  std::optional<ObjectsReport> objects;
  std::optional<BoxesReport> boxes;
  std::optional<TrajectoryReport> trajectory;
  std::vector<std::string> notes;  // figures that could not be measured, with the reason
};

// Compares the output of a run in out_dir (objects/*.ply in the World frame, cuboids.json, trajectory.txt) with gt/,
// objects.yaml and groundtruth.txt of the sequence, ignoring inferred true points. With `poses_given` both worlds are
// the same and nothing is aligned. Otherwise cuboids and meshes are transformed by the Sim3 that aligns the
// trajectories, and each mesh is then aligned by a rigid ICP. Figures that cannot be measured are reported in `notes`.
RunReport EvaluateRun(const std::string& out_dir, const std::string& sequence_dir, bool poses_given);

// Formats a report as text tables.
std::string FormatTable(const ObjectsReport& report);
std::string FormatTable(const BoxesReport& report);
std::string FormatTable(const TrajectoryReport& report);
std::string FormatTable(const RunReport& report);

// Converts a report to JSON; absent figures are null.
nlohmann::ordered_json ToJson(const ObjectsReport& report);
nlohmann::ordered_json ToJson(const BoxesReport& report);
nlohmann::ordered_json ToJson(const TrajectoryReport& report);
nlohmann::ordered_json ToJson(const RunReport& report);

}  // namespace romap::eval
