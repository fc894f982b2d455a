#include "client/eval/trajectory_eval.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "client/files/pose_uncertainty_file.h"
#include "common/angles.h"
#include "common/statistics.h"

namespace romap::eval {
namespace {

constexpr size_t kMinPairs = 3;

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double RootMeanSquare(std::vector<double> values) {
  for (double& value : values) value *= value;
  return std::sqrt(Mean(values));
}

std::vector<int64_t> PoseTimestamps(const std::vector<files::StampedPose>& poses) {
  std::vector<int64_t> timestamps_ns;
  for (const files::StampedPose& pose : poses) timestamps_ns.push_back(pose.timestamp_ns);
  return timestamps_ns;
}

// Root mean square distance of the true positions from their mean.
double ExtentOf(const std::vector<PosePair>& pairs) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const PosePair& pair : pairs) mean += pair.truth.translation() / static_cast<double>(pairs.size());
  std::vector<double> distances_m;
  for (const PosePair& pair : pairs) distances_m.push_back((pair.truth.translation() - mean).norm());
  return RootMeanSquare(std::move(distances_m));
}

Sim3<World, World> Fit(const std::vector<PosePair>& pairs, Alignment alignment) {
  if (alignment == Alignment::kNone) return {};
  Points estimated, truth;
  std::vector<Eigen::Matrix3d> rotations;
  for (const PosePair& pair : pairs) {
    estimated.push_back(pair.estimated.translation());
    truth.push_back(pair.truth.translation());
    rotations.push_back((pair.truth.rotation() * pair.estimated.rotation().conjugate()).toRotationMatrix());
  }
  const auto similarity = FitSimilarity(estimated, truth, alignment == Alignment::kSim3);
  return similarity ? *similarity : AlignMeans(estimated, truth, MeanRotation(rotations));
}

// Absolute errors of the aligned poses.
std::vector<PoseError> ErrorsOf(const std::vector<PosePair>& pairs, const Sim3<World, World>& S_gt_est) {
  std::vector<PoseError> errors;
  for (const PosePair& pair : pairs) {
    const SE3<World, Camera> aligned = S_gt_est.Moved(pair.estimated);
    errors.push_back({(aligned.translation() - pair.truth.translation()).norm(),
                      pair.truth.rotation().angularDistance(aligned.rotation()) * kDegPerRad});
  }
  return errors;
}

void AddAbsoluteErrors(const std::vector<PoseError>& errors, TrajectoryReport* report) {
  std::vector<double> errors_m, angles_deg;
  for (const PoseError& error : errors) {
    errors_m.push_back(error.position_m);
    angles_deg.push_back(error.rotation_deg);
  }
  report->ate_rmse_m = RootMeanSquare(errors_m);
  report->ate_mean_m = Mean(errors_m);
  report->ate_median_m = Quantile(errors_m, 0.5);
  report->ate_max_m = *std::max_element(errors_m.begin(), errors_m.end());
  report->rotation_rmse_deg = RootMeanSquare(angles_deg);
  report->rotation_max_deg = *std::max_element(angles_deg.begin(), angles_deg.end());
}

}  // namespace

absl::StatusOr<TrajectoryReport> CompareTrajectories(const TrajectoryInput& input, Alignment alignment,
                                                     double max_dt_s) {
  ROMAP_ASSIGN_OR_RETURN(const PoseAssociation associated,
                         AssociatePoses(input.estimated, input.ground_truth, max_dt_s, kMinPairs));
  std::vector<PosePair> pairs;
  for (const auto& [i, j] : associated) {
    const files::StampedPose& truth = input.ground_truth[j];
    pairs.push_back({truth.timestamp_ns, input.estimated[i].T_world_camera, truth.T_world_camera});
  }
  const Sim3<World, World> S_gt_est = Fit(pairs, alignment);
  TrajectoryReport report{.alignment = alignment,
                          .estimated_poses = input.estimated.size(),
                          .ground_truth_poses = input.ground_truth.size(),
                          .matched = pairs.size(),
                          .scale = S_gt_est.scale(),
                          .extent_m = ExtentOf(pairs)};
  for (size_t k = 1; k < pairs.size(); ++k) {
    report.path_length_m += (pairs[k].truth.translation() - pairs[k - 1].truth.translation()).norm();
  }
  const std::vector<PoseError> errors = ErrorsOf(pairs, S_gt_est);
  AddAbsoluteErrors(errors, &report);
  report.motion = MeasureMotion(pairs, report.extent_m, report.scale);
  const std::vector<int64_t> poses_ns = PoseTimestamps(input.estimated);
  report.coverage = input.frames_ns.empty() ? InferCoverage(poses_ns, input.ground_truth.front().timestamp_ns,
                                                            input.ground_truth.back().timestamp_ns)
                                            : CoverageOf(input.frames_ns, poses_ns);
  std::vector<std::optional<PoseUncertainty>> uncertainties;
  for (const auto& [i, j] : associated) uncertainties.push_back(input.estimated[i].uncertainty);
  report.calibration = MeasureCalibration(errors, uncertainties, report.scale);
  report.verdict = Judge(report);
  return report;
}

absl::StatusOr<TrajectoryReport> EvaluateTrajectory(const TrajectoryEvalOptions& options) {
  TrajectoryInput input{.frames_ns = options.frames_ns};
  ROMAP_ASSIGN_OR_RETURN(input.estimated, files::ReadTum(options.estimated));
  const std::string uncertainties = files::UncertaintyPath(options.estimated);
  std::error_code error;
  if (std::filesystem::exists(uncertainties, error)) {
    ROMAP_RETURN_IF_ERROR(files::ReadUncertainties(uncertainties, &input.estimated));
  }
  ROMAP_ASSIGN_OR_RETURN(input.ground_truth, files::ReadTum(options.ground_truth));
  return CompareTrajectories(input, options.alignment, options.max_dt_s);
}

}  // namespace romap::eval
