#include "server/slam/optimise/reprojection_cost.h"

#include <algorithm>

#include "server/slam/optimise/lie.h"

namespace romap {
namespace {

using Vector3Map = Eigen::Map<const Eigen::Vector3d>;
using RowVector3 = Eigen::RowVector3d;
using CameraJacobian = Eigen::Map<Eigen::Matrix<double, 2, 6, Eigen::RowMajor>>;
using PointJacobian = Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>;

// In units of sigma, per axis; far beyond any bound, and Huber's loss makes it grow only linearly.
constexpr double kResidualWithoutImage = 100;

void SetWithoutImage(double* residuals, double** jacobians) {
  residuals[0] = residuals[1] = kResidualWithoutImage;
  if (jacobians == nullptr) return;
  if (jacobians[0] != nullptr) std::fill_n(jacobians[0], 12, 0.0);
  if (jacobians[1] != nullptr) std::fill_n(jacobians[1], 6, 0.0);
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
  const CameraState& state = *state_;
  const Eigen::Vector3d p_camera = state.R_camera_world * (Vector3Map(parameters[1]) - state.t_world_camera);
  if (p_camera.z() < kMinBundleDepth) {
    SetWithoutImage(residuals, jacobians);
    return true;
  }
  const double inverse_z = 1 / p_camera.z();
  const double x = p_camera.x() * inverse_z;
  const double y = p_camera.y() * inverse_z;
  residuals[0] = weight_x_ * (x - measured_x_);
  residuals[1] = weight_y_ * (y - measured_y_);
  if (jacobians == nullptr) return true;

  // Of the residuals by the point in the camera's frame.
  const RowVector3 dx(weight_x_ * inverse_z, 0, -weight_x_ * inverse_z * x);
  const RowVector3 dy(0, weight_y_ * inverse_z, -weight_y_ * inverse_z * y);
  if (jacobians[0] != nullptr) {
    // A camera's turn moves the point by Hat(p_camera), its shift by -1 (both in its own frame).
    const RowVector3 turn_x(weight_x_ * x * y, -weight_x_ * (1 + x * x), weight_x_ * y);
    const RowVector3 turn_y(weight_y_ * (1 + y * y), -weight_y_ * x * y, -weight_y_ * x);
    CameraJacobian jacobian(jacobians[0]);
    jacobian.block<1, 3>(0, 0).noalias() = turn_x * state.rotation_jacobian;
    jacobian.block<1, 3>(1, 0).noalias() = turn_y * state.rotation_jacobian;
    jacobian.block<1, 3>(0, 3).noalias() = -dx * state.translation_jacobian;
    jacobian.block<1, 3>(1, 3).noalias() = -dy * state.translation_jacobian;
  }
  if (jacobians[1] != nullptr) {
    PointJacobian jacobian(jacobians[1]);
    jacobian.row(0).noalias() = dx * state.R_camera_world;
    jacobian.row(1).noalias() = dy * state.R_camera_world;
  }
  return true;
}

InverseDepthCost::InverseDepthCost(const CameraState* state, double depth, double depth_sigma)
    : state_(state), measured_(1 / depth), weight_(depth * depth / depth_sigma) {}

bool InverseDepthCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const CameraState& state = *state_;
  const Eigen::Vector3d p_camera = state.R_camera_world * (Vector3Map(parameters[1]) - state.t_world_camera);
  if (p_camera.z() < kMinBundleDepth) {
    SetWithoutImage(residuals, jacobians);
    return true;
  }
  const double inverse_z = 1 / p_camera.z();
  residuals[0] = weight_ * (inverse_z - measured_);
  residuals[1] = 0;
  if (jacobians == nullptr) return true;

  const double by_z = -weight_ * inverse_z * inverse_z;
  if (jacobians[0] != nullptr) {
    const RowVector3 turn(-by_z * p_camera.y(), by_z * p_camera.x(), 0);
    CameraJacobian jacobian(jacobians[0]);
    jacobian.block<1, 3>(0, 0).noalias() = turn * state.rotation_jacobian;
    jacobian.block<1, 3>(0, 3) = -by_z * state.translation_jacobian.row(2);
    jacobian.row(1).setZero();
  }
  if (jacobians[1] != nullptr) {
    PointJacobian jacobian(jacobians[1]);
    jacobian.row(0) = by_z * state.R_camera_world.row(2);
    jacobian.row(1).setZero();
  }
  return true;
}

PosePriorCost::PosePriorCost(const CameraState* state, const PosePrior& prior) : state_(state), prior_(prior) {}

bool PosePriorCost::Evaluate(double const* const* /*parameters*/, double* residuals, double** jacobians) const {
  const CameraState& state = *state_;
  const Eigen::Matrix3d R_world_camera = state.R_camera_world.transpose();
  const Eigen::Vector3d turn_rad =
      LogRotation(Eigen::Quaterniond(prior_.T_world_camera.RotationMatrix().transpose() * R_world_camera));
  Eigen::Map<Eigen::Matrix<double, 6, 1>> residual(residuals);
  residual.head<3>() = turn_rad / prior_.rotation_sigma_rad;
  residual.tail<3>() = (state.t_world_camera - prior_.T_world_camera.translation()) / prior_.translation_sigma_mu;
  if (jacobians == nullptr || jacobians[0] == nullptr) return true;

  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>> jacobian(jacobians[0]);
  jacobian.setZero();
  jacobian.topLeftCorner<3, 3>() =
      RightJacobianOfRotation(turn_rad).inverse() * state.rotation_jacobian / prior_.rotation_sigma_rad;
  jacobian.bottomRightCorner<3, 3>() = state.R_start / prior_.translation_sigma_mu;
  return true;
}

}  // namespace romap
