#include "server/slam/geometry/reprojection.h"

#include <cmath>

#include "server/slam/geometry/rotation.h"

namespace romap::slam {
namespace {

// Cost of a point that a step moves behind the camera: more than any step can gain, but finite, so that one wrong match
// near the camera does not block all steps.
constexpr double kCostBehindCamera = 1e4;

}  // namespace

void AddObservation(const CameraModel& camera, const CameraFromWorld& pose, const PoseObservation& observation,
                    PoseEquations& equations) {
  const ObservationError error = ErrorOf(camera, pose, observation);
  const double bound = Chi2Bound(observation);
  if (!std::isfinite(error.chi2)) {
    equations.cost += kCostBehindCamera;
    return;
  }
  const double inverse_z = 1 / error.p_camera.z();
  const double x = error.p_camera.x() * inverse_z;
  const double y = error.p_camera.y() * inverse_z;
  const double fx = camera.fx_px / observation.sigma_px;
  const double fy = camera.fy_px / observation.sigma_px;
  const double weight = HuberWeight(error.chi2, bound);
  PoseEquations::Vector derivative;
  derivative << fx * inverse_z, 0, -fx * x * inverse_z, -fx * x * y, fx * (1 + x * x), -fx * y;
  equations.Add(derivative, error.pixel.x(), weight);
  derivative << 0, fy * inverse_z, -fy * y * inverse_z, -fy * (1 + y * y), fy * x * y, fy * x;
  equations.Add(derivative, error.pixel.y(), weight);
  if (HasDepth(observation)) {
    const double scale = 1 / observation.depth_sigma_mu;
    derivative << 0, 0, scale, scale * error.p_camera.y(), -scale * error.p_camera.x(), 0;
    equations.Add(derivative, error.depth, weight);
  }
  equations.cost += HuberCost(error.chi2, bound);
}

CameraFromWorld ApplyStep(const CameraFromWorld& pose, const PoseEquations::Vector& step) {
  const Eigen::Matrix3d rotation = ExpRotationMatrix(step.tail<3>());
  return {rotation * pose.rotation, rotation * pose.translation + step.head<3>()};
}

}  // namespace romap::slam
