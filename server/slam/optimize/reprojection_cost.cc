#include "server/slam/optimize/reprojection_cost.h"

#include <algorithm>

#include "server/slam/optimize/lie.h"

namespace romap::slam {
namespace {

// In units of sigma, per residual. Far beyond any bound, where the Huber loss is linear.
constexpr double kResidualBehindCamera = 100;

Eigen::Vector3d PointInCamera(const CameraState& state, const double* p_world) {
  return state.R_camera_world * (Eigen::Map<const Eigen::Vector3d>(p_world) - state.t_world_camera);
}

void SetBehindCamera(int rows, double* residuals, double** jacobians) {
  std::fill_n(residuals, rows, kResidualBehindCamera);
  if (jacobians == nullptr) return;
  if (jacobians[0] != nullptr) std::fill_n(jacobians[0], 6 * rows, 0.0);
  if (jacobians[1] != nullptr) std::fill_n(jacobians[1], 3 * rows, 0.0);
}

// Sets row `row` of the Jacobians from `by_p_camera`, the derivative of the residual with respect to the point in the
// camera's frame. A rotation w of the camera moves that point by Hat(p_camera) * w, a translation v by -v.
void SetJacobianRow(int row, const CameraState& state, const Eigen::Vector3d& p_camera,
                    const Eigen::RowVector3d& by_p_camera, double** jacobians) {
  if (jacobians[0] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 1, 6>> by_camera(jacobians[0] + 6 * row);
    by_camera.head<3>().noalias() = by_p_camera.cross(p_camera.transpose()) * state.rotation_jacobian;
    by_camera.tail<3>().noalias() = -by_p_camera * state.translation_jacobian;
  }
  if (jacobians[1] != nullptr) {
    Eigen::Map<Eigen::RowVector3d> by_point(jacobians[1] + 3 * row);
    by_point.noalias() = by_p_camera * state.R_camera_world;
  }
}

}  // namespace

ReprojectionCost::ReprojectionCost(const CameraModel& camera, const CameraState* state, const Eigen::Vector2d& pixel_px,
                                   double sigma_px)
    : state_(state),
      measured_x_((pixel_px.x() - camera.cx_px) / camera.fx_px),
      measured_y_((pixel_px.y() - camera.cy_px) / camera.fy_px),
      weight_x_(camera.fx_px / sigma_px),
      weight_y_(camera.fy_px / sigma_px) {}

bool ReprojectionCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Eigen::Vector3d p_camera = PointInCamera(*state_, parameters[1]);
  if (p_camera.z() < kMinBundleDepth) {
    SetBehindCamera(2, residuals, jacobians);
    return true;
  }
  const double inverse_z = 1 / p_camera.z();
  const double x = p_camera.x() * inverse_z;
  const double y = p_camera.y() * inverse_z;
  residuals[0] = weight_x_ * (x - measured_x_);
  residuals[1] = weight_y_ * (y - measured_y_);
  if (jacobians == nullptr) return true;
  SetJacobianRow(0, *state_, p_camera, weight_x_ * inverse_z * Eigen::RowVector3d(1, 0, -x), jacobians);
  SetJacobianRow(1, *state_, p_camera, weight_y_ * inverse_z * Eigen::RowVector3d(0, 1, -y), jacobians);
  return true;
}

ReprojectionDepthCost::ReprojectionDepthCost(const CameraModel& camera, const CameraState* state,
                                             const Eigen::Vector2d& pixel_px, double sigma_px, double depth,
                                             double depth_sigma)
    : reprojection_(camera, state, pixel_px, sigma_px),
      state_(state),
      measured_(1 / depth),
      weight_(depth * depth / depth_sigma) {}

bool ReprojectionDepthCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Eigen::Vector3d p_camera = PointInCamera(*state_, parameters[1]);
  if (p_camera.z() < kMinBundleDepth) {
    SetBehindCamera(3, residuals, jacobians);
    return true;
  }
  reprojection_.Evaluate(parameters, residuals, jacobians);  // the first two rows
  const double inverse_z = 1 / p_camera.z();
  residuals[2] = weight_ * (inverse_z - measured_);
  if (jacobians == nullptr) return true;
  SetJacobianRow(2, *state_, p_camera, Eigen::RowVector3d(0, 0, -weight_ * inverse_z * inverse_z), jacobians);
  return true;
}

PosePriorCost::PosePriorCost(const CameraState* state, const PosePrior& prior) : state_(state), prior_(prior) {}

bool PosePriorCost::Evaluate(double const* const* /*parameters*/, double* residuals, double** jacobians) const {
  const CameraState& state = *state_;
  const Eigen::Matrix3d R_world_camera = state.R_camera_world.transpose();
  const Eigen::Vector3d rotation_rad =
      LogRotation(Eigen::Quaterniond(prior_.T_world_camera.RotationMatrix().transpose() * R_world_camera));
  Eigen::Map<Eigen::Matrix<double, 6, 1>> residual(residuals);
  residual.head<3>() = rotation_rad / prior_.rotation_sigma_rad;
  residual.tail<3>() = (state.t_world_camera - prior_.T_world_camera.translation()) / prior_.translation_sigma_mu;
  if (jacobians == nullptr || jacobians[0] == nullptr) return true;

  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>> jacobian(jacobians[0]);
  jacobian.setZero();
  jacobian.topLeftCorner<3, 3>() =
      RightJacobianOfRotation(rotation_rad).inverse() * state.rotation_jacobian / prior_.rotation_sigma_rad;
  jacobian.bottomRightCorner<3, 3>() = state.R_start / prior_.translation_sigma_mu;
  return true;
}

}  // namespace romap::slam
