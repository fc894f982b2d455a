#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/eval/alignment.h"
#include "client/eval/calibration.h"
#include "client/eval/frame_coverage.h"
#include "client/eval/relative_motion.h"
#include "client/eval/verdict.h"
#include "client/files/tum.h"
#include "common/status.h"

namespace romap::eval {

struct TrajectoryEvalOptions {
  std::string estimated;  // TUM file; the uncertainties beside it are compared with the errors (files::UncertaintyPath)
  std::string ground_truth;  // TUM file
  Alignment alignment = Alignment::kSim3;
  double max_dt_s = 0.02;  // maximal time difference of associated poses
  // Timestamps of all frames of the run, sorted. If empty, their number is inferred (InferCoverage).
  std::vector<int64_t> frames_ns = {};
};

// A trajectory to compare.
struct TrajectoryInput {
  std::vector<files::StampedPose> estimated = {};     // sorted by time; uncertainties enable the calibration figures
  std::vector<files::StampedPose> ground_truth = {};  // sorted by time
  std::vector<int64_t> frames_ns = {};                // as in TrajectoryEvalOptions
};

// Absolute trajectory error (Sturm et al., IROS 2012) and figures that no alignment can improve. Lengths are in the
// unit of the ground truth, meters.
struct TrajectoryReport {
  Alignment alignment = Alignment::kSim3;
  size_t estimated_poses = 0;
  size_t ground_truth_poses = 0;
  size_t matched = 0;
  double scale = 1;  // of the alignment, from estimated to true lengths; > 0. See motion.scale for the sign
  double path_length_m = 0;
  double extent_m = 0;  // rms distance of the true positions from their mean
  double ate_rmse_m = 0;
  double ate_mean_m = 0;
  double ate_median_m = 0;
  double ate_max_m = 0;
  double rotation_rmse_deg = 0;
  double rotation_max_deg = 0;
  MotionFigures motion = {};
  FrameCoverage coverage = {};
  std::optional<Calibration> calibration = std::nullopt;
  Verdict verdict = {};

  // The ATE relative to the extent: 1 if the estimated positions are unrelated to the true ones. The alignment by Sim3
  // then shrinks them to a point.
  double AteShare() const { return extent_m > 0 ? ate_rmse_m / extent_m : 0; }
};

// Compares two trajectories. If positions determine no alignment, the mean orientation does, with scale 1.
// INVALID_ARGUMENT: fewer than three associated poses.
absl::StatusOr<TrajectoryReport> CompareTrajectories(const TrajectoryInput& input, Alignment alignment,
                                                     double max_dt_s);

// Compares two trajectory files. Errors as ReadTum, ReadUncertainties and CompareTrajectories.
absl::StatusOr<TrajectoryReport> EvaluateTrajectory(const TrajectoryEvalOptions& options);

}  // namespace romap::eval
