#include "server/slam/geometry/pose_covariance.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "server/slam/geometry/reprojection.h"

namespace romap::slam {
namespace {

// Few inliers may agree better than they are accurate.
constexpr double kMinVarianceFactor = 0.04;
// The share of chi-square's mean that is left below its 95 % bound, with two degrees of freedom.
constexpr double kMeanShareOfInliers = 0.842;
constexpr double kMinReciprocalCondition = 1e-14;

}  // namespace

std::optional<Eigen::Matrix<double, 6, 6>> PoseCovariance(const CameraModel& camera, const PoseEstimate& estimate,
                                                          std::span<const PoseObservation> observations) {
  const SE3<Camera, World> T_camera_world = estimate.T_world_camera.Inverse();
  const CameraFromWorld pose{T_camera_world.RotationMatrix(), T_camera_world.translation()};
  PoseEquations equations;
  int errors = 0;
  for (size_t i = 0; i < observations.size(); ++i) {
    if (estimate.inlier[i] == 0) continue;
    AddObservation(camera, pose, observations[i], equations);
    errors += HasDepth(observations[i]) ? 3 : 2;
  }
  constexpr int kParameters = 6;
  if (errors <= kParameters) return std::nullopt;
  const Eigen::LDLT<PoseEquations::Matrix> factors(equations.hessian);
  if (!factors.isPositive() || factors.rcond() < kMinReciprocalCondition) return std::nullopt;
  const double variance_factor = equations.cost / (kMeanShareOfInliers * (errors - kParameters));
  return std::max(kMinVarianceFactor, variance_factor) * factors.solve(PoseEquations::Matrix::Identity());
}

double EquivalentSigma(const Eigen::Matrix3d& covariance) {
  constexpr double kNormalQuantile95 = 1.6449;
  const double mean = covariance.trace();
  if (!(mean > 0)) return 0;
  const double freedom = mean * mean / covariance.squaredNorm();
  const double spread = 2 / (9 * freedom);
  const double quantile = mean * std::pow(1 - spread + kNormalQuantile95 * std::sqrt(spread), 3);
  return std::sqrt(quantile) / kSigmasTo95;
}

}  // namespace romap::slam
