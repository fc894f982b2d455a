#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/eval/boxes_eval.h"
#include "client/eval/objects_eval.h"
#include "client/eval/trajectory_eval.h"

namespace romap::eval {

// All that can be measured of one run against the ground truth its sequence has.
struct RunReport {
  std::optional<ObjectsReport> objects;
  std::optional<BoxesReport> boxes;
  std::optional<TrajectoryReport> trajectory;
  std::vector<std::string> notes;  // what was not measured, and why
};

// Measures what a run wrote to out_dir (objects/*.ply in world frame, cuboids.json, trajectory.txt) against gt/,
// objects.yaml and groundtruth.txt of the sequence, without the inferred undersides. With `poses_given` the worlds are
// the same and nothing is aligned; otherwise cuboids and meshes are moved by the Sim3 of the trajectories, and each
// mesh then by a rigid ICP. Never fails as a whole: what cannot be measured becomes a note.
RunReport EvaluateRun(const std::string& out_dir, const std::string& sequence_dir, bool poses_given);

// Tables for people.
std::string FormatTable(const ObjectsReport& report);
std::string FormatTable(const BoxesReport& report);
std::string FormatTable(const TrajectoryReport& report);
std::string FormatTable(const RunReport& report);

// The same for programs; absent figures are null.
nlohmann::ordered_json ToJson(const ObjectsReport& report);
nlohmann::ordered_json ToJson(const BoxesReport& report);
nlohmann::ordered_json ToJson(const TrajectoryReport& report);
nlohmann::ordered_json ToJson(const RunReport& report);

}  // namespace romap::eval
