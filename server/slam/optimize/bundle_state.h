#pragma once

#include <ceres/evaluation_callback.h>

#include <Eigen/Core>
#include <array>
#include <vector>

#include "common/geometry.h"

namespace romap::slam {

// A camera in the optimization: a start pose and an increment, R = R_start * Exp(w), t = t_start + R_start * v. Ceres
// varies the increment. It is a plain vector of size 6 and needs no Manifold. With a Manifold, Ceres would multiply the
// Jacobian of each of thousands of observations by the Jacobian of the Manifold, with sizes known only at run time.
// Values that the observations of a camera share are computed once per evaluation (Refresh) instead of once per
// observation.
struct CameraState {
  // `start`: lengths in the unit of the optimization.
  explicit CameraState(const SE3<World, Camera>& start);

  // Recomputes the members that depend on `increment`.
  void Refresh();
  SE3<World, Camera> Pose() const;

  std::array<double, 6> increment{};  // w (rad), v

  Eigen::Quaterniond start_rotation;
  Eigen::Matrix3d R_start;
  Eigen::Vector3d t_start;

  // At the current increment:
  Eigen::Matrix3d R_camera_world;
  Eigen::Vector3d t_world_camera;
  Eigen::Matrix3d rotation_jacobian;  // right Jacobian at w: rotation of the camera, in its own frame, per change of w
  Eigen::Matrix3d translation_jacobian;  // Exp(-w): translation of the camera, in its own frame, per change of v
};

// Refreshes all cameras before Ceres evaluates.
class RefreshCameras : public ceres::EvaluationCallback {
 public:
  explicit RefreshCameras(std::vector<CameraState>* cameras) : cameras_(cameras) {}

  void PrepareForEvaluation(bool evaluate_jacobians, bool new_evaluation_point) override;

 private:
  std::vector<CameraState>* cameras_;
};

}  // namespace romap::slam
