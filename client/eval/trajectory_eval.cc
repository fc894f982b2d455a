#include "client/eval/trajectory_eval.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/files/tum.h"
#include "common/statistics.h"

namespace romap::eval {
namespace {

constexpr double kDegPerRad = 180 / std::numbers::pi;

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double RootMeanSquare(std::vector<double> values) {
  for (double& value : values) value *= value;
  return std::sqrt(Mean(values));
}

}  // namespace

absl::StatusOr<TrajectoryReport> EvaluateTrajectory(const TrajectoryEvalOptions& options) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<files::StampedPose> estimated, files::ReadTum(options.estimated));
  ROMAP_ASSIGN_OR_RETURN(const std::vector<files::StampedPose> truth, files::ReadTum(options.ground_truth));
  ROMAP_ASSIGN_OR_RETURN(const TrajectoryFit fit,
                         AlignTrajectories(estimated, truth, options.alignment, options.max_dt_s));
  TrajectoryReport report{.alignment = options.alignment,
                          .estimated_poses = estimated.size(),
                          .ground_truth_poses = truth.size(),
                          .matched = fit.pairs.size(),
                          .scale = fit.S_gt_est.scale()};
  std::vector<double> errors_m, angles_deg;
  for (size_t k = 0; k < fit.pairs.size(); ++k) {
    const SE3<World, Camera> T_gt_camera = fit.S_gt_est.Moved(estimated[fit.pairs[k].first].T_world_camera);
    const SE3<World, Camera>& T_gt_true = truth[fit.pairs[k].second].T_world_camera;
    errors_m.push_back((T_gt_camera.translation() - T_gt_true.translation()).norm());
    angles_deg.push_back(T_gt_true.rotation().angularDistance(T_gt_camera.rotation()) * kDegPerRad);
    if (k == 0) continue;
    const SE3<World, Camera>& T_gt_previous = truth[fit.pairs[k - 1].second].T_world_camera;
    report.path_length_m += (T_gt_true.translation() - T_gt_previous.translation()).norm();
  }
  report.ate_rmse_m = RootMeanSquare(errors_m);
  report.ate_mean_m = Mean(errors_m);
  report.ate_median_m = Quantile(errors_m, 0.5);
  report.ate_max_m = *std::max_element(errors_m.begin(), errors_m.end());
  report.rotation_rmse_deg = RootMeanSquare(angles_deg);
  report.rotation_max_deg = *std::max_element(angles_deg.begin(), angles_deg.end());
  return report;
}

}  // namespace romap::eval
