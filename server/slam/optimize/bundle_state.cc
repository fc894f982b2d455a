#include "server/slam/optimize/bundle_state.h"

#include "server/slam/optimize/lie.h"

namespace romap::slam {

CameraState::CameraState(const SE3<World, Camera>& start)
    : start_rotation(start.rotation()), R_start(start.RotationMatrix()), t_start(start.translation()) {
  Refresh();
}

void CameraState::Refresh() {
  const Eigen::Map<const Eigen::Vector3d> w(increment.data());
  const Eigen::Map<const Eigen::Vector3d> v(increment.data() + 3);
  translation_jacobian = ExpRotation(w).toRotationMatrix().transpose();
  rotation_jacobian = RightJacobianOfRotation(w);
  R_camera_world = translation_jacobian * R_start.transpose();
  t_world_camera = t_start + R_start * v;
}

SE3<World, Camera> CameraState::Pose() const {
  const Eigen::Map<const Eigen::Vector3d> w(increment.data());
  const Eigen::Map<const Eigen::Vector3d> v(increment.data() + 3);
  return {start_rotation * ExpRotation(w), t_start + R_start * v};
}

void RefreshCameras::PrepareForEvaluation(bool /*evaluate_jacobians*/, bool new_evaluation_point) {
  if (!new_evaluation_point) return;
  for (CameraState& camera : *cameras_) camera.Refresh();
}

}  // namespace romap::slam
