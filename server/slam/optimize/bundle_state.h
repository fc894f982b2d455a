#pragma once

#include <ceres/evaluation_callback.h>

#include <Eigen/Core>
#include <array>
#include <vector>

#include "common/geometry.h"

namespace romap::slam {

// A camera in the optimization: a start and an increment on it, R = R_start * Exp(w), t = t_start + R_start * v.
// The increment is what Ceres varies. Being a plain vector of six it needs no Manifold, by whose Jacobian Ceres would
// multiply (with sizes known only at run time) that of each of thousands of observations; and all that the observations
// of a camera have in common is computed once per evaluation (Refresh) instead of once for each.
struct CameraState {
  // `start` in the lengths of the optimization.
  explicit CameraState(const SE3<World, Camera>& start);

  // Brings what follows `increment` up to date.
  void Refresh();
  SE3<World, Camera> Pose() const;

  std::array<double, 6> increment{};  // w (rad), v

  Eigen::Quaterniond start_rotation;
  Eigen::Matrix3d R_start;
  Eigen::Vector3d t_start;

  // At the current increment:
  Eigen::Matrix3d R_camera_world;
  Eigen::Vector3d t_world_camera;
  Eigen::Matrix3d rotation_jacobian;     // right Jacobian at w: turn of the camera, in its own frame, by change of w
  Eigen::Matrix3d translation_jacobian;  // Exp(-w): shift of the camera, in its own frame, by change of v
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
