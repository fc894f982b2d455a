#pragma once

#include <cstddef>
#include <string>

#include "client/eval/alignment.h"
#include "common/status.h"

namespace romap::eval {

struct TrajectoryEvalOptions {
  std::string estimated;     // TUM file
  std::string ground_truth;  // TUM file
  Alignment alignment = Alignment::kSim3;
  double max_dt_s = 0.02;  // maximal time difference of associated poses
};

// Absolute trajectory error (Sturm et al., IROS 2012). Lengths are in the unit of the ground truth, meters.
struct TrajectoryReport {
  Alignment alignment = Alignment::kSim3;
  size_t estimated_poses = 0;
  size_t ground_truth_poses = 0;
  size_t matched = 0;
  double scale = 1;  // from estimated to true lengths
  double path_length_m = 0;
  double ate_rmse_m = 0;
  double ate_mean_m = 0;
  double ate_median_m = 0;
  double ate_max_m = 0;
  double rotation_rmse_deg = 0;
  double rotation_max_deg = 0;
};

// Compares two trajectory files. Errors as ReadTum and AlignTrajectories.
absl::StatusOr<TrajectoryReport> EvaluateTrajectory(const TrajectoryEvalOptions& options);

}  // namespace romap::eval
