#include "server/slam/optimize/bundle_adjustment.h"

#include <cmath>
#include <limits>
#include <utility>

#include "common/statistics.h"
#include "server/slam/optimize/bundle_solver.h"

namespace romap::slam {
namespace {

bool IsValid(const BundleProblem& problem, const BundleObservation& observation) {
  const auto cameras = static_cast<int>(problem.cameras.size());
  const auto points = static_cast<int>(problem.points.size());
  if (observation.camera < 0 || observation.camera >= cameras) return false;
  if (observation.point < 0 || observation.point >= points) return false;
  return observation.pixel_px.allFinite() && observation.sigma_px > 0 && std::isfinite(observation.sigma_px) &&
         std::isfinite(observation.depth_mu) && std::isfinite(observation.depth_sigma_mu) &&
         problem.cameras[observation.camera].T_world_camera.IsFinite() &&
         problem.points[observation.point].position_world.allFinite();
}

bool IsValid(const CameraModel& camera) {
  return camera.fx_px > 0 && camera.fy_px > 0 && std::isfinite(camera.fx_px) && std::isfinite(camera.fy_px) &&
         std::isfinite(camera.cx_px) && std::isfinite(camera.cy_px);
}

struct ObservationError {
  double reprojection_px2 = std::numeric_limits<double>::infinity();
  double chi2 = std::numeric_limits<double>::infinity();
  bool beyond_bound = true;
};

// Returns the default values for invalid numbers and for points behind the camera.
ObservationError Measure(const BundleProblem& problem, const BundleObservation& observation) {
  ObservationError error;
  if (!IsValid(problem, observation)) return error;
  const SE3<World, Camera>& T_world_camera = problem.cameras[observation.camera].T_world_camera;
  const Eigen::Vector3d p_camera = T_world_camera.rotation().conjugate() *
                                   (problem.points[observation.point].position_world - T_world_camera.translation());
  if (!(p_camera.z() > 0)) return error;
  Eigen::Vector2d pixel_px = problem.camera.Project(p_camera);
  if (problem.lens) pixel_px = problem.lens->correction.Distort(problem.camera, pixel_px);
  error.reprojection_px2 = (pixel_px - observation.pixel_px).squaredNorm();
  error.chi2 = error.reprojection_px2 / (observation.sigma_px * observation.sigma_px);
  double bound = kChi2Bound2;
  if (HasDepth(observation)) {
    const double depth_mu = observation.depth_mu;
    const double inverse_depth_sigma = observation.depth_sigma_mu / (depth_mu * depth_mu);
    const double deviation = (1 / p_camera.z() - 1 / depth_mu) / inverse_depth_sigma;
    error.chi2 += deviation * deviation;
    bound = kChi2Bound3;
  }
  error.beyond_bound = !(error.chi2 <= bound);
  return error;
}

// Root of the mean squared reprojection error of the observations with `use` != 0, weighted by 1 / sigma^2.
double RmsPx(const BundleProblem& problem, const std::vector<uint8_t>& use) {
  double sum = 0;
  double weights = 0;
  for (size_t i = 0; i < use.size(); ++i) {
    if (!use[i]) continue;
    const BundleObservation& observation = problem.observations[i];
    const double weight = 1 / (observation.sigma_px * observation.sigma_px);
    sum += weight * Measure(problem, observation).reprojection_px2;
    weights += weight;
  }
  return weights > 0 ? std::sqrt(sum / weights) : 0;
}

// Selects the observations to use: not marked as outliers, in front of the camera and, if requested, within the bound.
std::vector<uint8_t> Select(const BundleProblem& problem, bool within_bound) {
  std::vector<uint8_t> use(problem.observations.size(), 0);
  for (size_t i = 0; i < use.size(); ++i) {
    const BundleObservation& observation = problem.observations[i];
    if (observation.outlier) continue;
    const ObservationError error = Measure(problem, observation);
    use[i] = within_bound ? !error.beyond_bound : std::isfinite(error.chi2);
  }
  return use;
}

void MarkOutliers(BundleProblem& problem, BundleSummary& summary) {
  for (BundleObservation& observation : problem.observations) {
    observation.outlier = Measure(problem, observation).beyond_bound;
    summary.outliers += observation.outlier;
  }
}

}  // namespace

BundleFit MeasureFit(const BundleProblem& problem) {
  BundleFit fit;
  std::vector<uint8_t> inliers(problem.observations.size(), 0);
  for (size_t i = 0; i < inliers.size(); ++i) {
    if (!IsValid(problem, problem.observations[i])) continue;
    ++fit.observations;
    inliers[i] = Measure(problem, problem.observations[i]).beyond_bound ? 0 : 1;
    fit.outliers += inliers[i] == 0 ? 1 : 0;
  }
  fit.rms_px = RmsPx(problem, inliers);
  return fit;
}

void ClassifyOutliers(BundleProblem& problem) {
  BundleSummary ignored;
  MarkOutliers(problem, ignored);
}

double MeasureNoise(const BundleProblem& problem) {
  constexpr double kMedianOfRayleigh = 1.177;  // of the length of a 2D error with standard deviation 1 per axis
  std::vector<double> errors;
  for (const BundleObservation& observation : problem.observations) {
    const double error_px2 = Measure(problem, observation).reprojection_px2;
    if (std::isfinite(error_px2)) errors.push_back(std::sqrt(error_px2) / observation.sigma_px);
  }
  return errors.empty() ? 1 : Median(std::move(errors)) / kMedianOfRayleigh;
}

BundleSummary AdjustBundle(BundleProblem& problem, const BundleOptions& options) {
  BundleSummary summary;
  if (!IsValid(problem.camera)) return summary;
  std::vector<uint8_t> use = Select(problem, /*within_bound=*/false);
  summary.initial_rms_px = summary.final_rms_px = RmsPx(problem, use);

  BundleRun run;
  const int first_iterations = options.reject_outliers ? (options.max_iterations + 1) / 2 : options.max_iterations;
  RunBundle(problem, use, options, first_iterations, run);
  summary.iterations = run.iterations;
  summary.aborted = run.aborted;
  summary.usable = run.usable;
  if (!run.usable) return summary;

  if (options.reject_outliers && !run.aborted) {
    std::vector<uint8_t> inliers = Select(problem, /*within_bound=*/true);
    if (!run.converged || inliers != use) {
      use = std::move(inliers);
      RunBundle(problem, use, options, options.max_iterations - first_iterations, run);
      summary.iterations += run.iterations;
      summary.aborted = run.aborted;
    }
  }
  MarkOutliers(problem, summary);
  summary.final_rms_px = RmsPx(problem, use);
  return summary;
}

}  // namespace romap::slam
