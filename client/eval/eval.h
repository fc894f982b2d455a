#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/eval/boxes_eval.h"
#include "client/eval/map_alignment.h"
#include "client/eval/objects_eval.h"
#include "client/eval/trajectory_eval.h"

namespace romap::eval {

// The figures of one run against the ground truth of its sequence.
struct RunReport {
  MapAlignment alignment = {};  // as used
  std::optional<ObjectsReport> objects = std::nullopt;
  std::optional<BoxesReport> boxes = std::nullopt;
  std::optional<TrajectoryReport> trajectory = std::nullopt;
  // WRONG if the sequence has true poses but the trajectory could not be compared with them; nullopt without true
  // poses.
  std::optional<Verdict> verdict = std::nullopt;
  std::vector<std::string> notes = {};  // figures that could not be measured, with the reason
};

// Compares the output of a run in out_dir (objects/*.ply in the World frame, cuboids.json, trajectory.txt) with gt/,
// objects.yaml and groundtruth.txt of the sequence, ignoring inferred true points. With the alignment kNone both worlds
// are the same and nothing is aligned. Otherwise cuboids and meshes are transformed by the alignment of the
// trajectories, and each mesh is then aligned by a rigid ICP. `frames_ns` are the timestamps of all frames of the run;
// if it is empty, their number is inferred. Figures that cannot be measured are reported in `notes`.
RunReport EvaluateRun(const std::string& out_dir, const std::string& sequence_dir, const MapAlignment& alignment,
                      const std::vector<int64_t>& frames_ns = {});

// Formats a report as text tables.
std::string FormatTable(const ObjectsReport& report);
std::string FormatTable(const BoxesReport& report);
std::string FormatTable(const TrajectoryReport& report);
std::string FormatTable(const RunReport& report);
// Only the trajectory and its verdict; empty without true poses.
std::string FormatTrajectory(const RunReport& report);

// Converts a report to JSON; absent figures are null.
nlohmann::ordered_json ToJson(const ObjectsReport& report);
nlohmann::ordered_json ToJson(const BoxesReport& report);
nlohmann::ordered_json ToJson(const TrajectoryReport& report);
nlohmann::ordered_json ToJson(const RunReport& report);

}  // namespace romap::eval
