#pragma once

#include <Eigen/Core>
#include <limits>

#include "common/camera_model.h"
#include "server/slam/geometry/levenberg_marquardt.h"
#include "server/slam/geometry/pose_refiner.h"

namespace romap::slam {

// A camera's pose in the form used by the inner loops: p_camera = rotation * p_world + translation.
struct CameraFromWorld {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
};

inline bool HasDepth(const PoseObservation& observation) {
  return observation.depth_mu > 0 && observation.depth_sigma_mu > 0;
}

// 95 % bound of chi-square: two degrees of freedom, or three if depth was measured.
inline double Chi2Bound(const PoseObservation& observation) { return HasDepth(observation) ? 7.815 : 5.991; }

// Residual of an observation for a pose: pixels and depth in units of their standard deviations.
struct ObservationError {
  Eigen::Vector3d p_camera;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double depth = 0;
  double chi2 = std::numeric_limits<double>::infinity();  // remains infinite behind the camera
};

inline ObservationError ErrorOf(const CameraModel& camera, const CameraFromWorld& pose,
                                const PoseObservation& observation) {
  ObservationError error;
  error.p_camera = pose.rotation * observation.p_world + pose.translation;
  if (!(error.p_camera.z() > 0)) return error;
  error.pixel = (camera.Project(error.p_camera) - observation.pixel_px) / observation.sigma_px;
  error.chi2 = error.pixel.squaredNorm();
  if (HasDepth(observation)) {
    error.depth = (error.p_camera.z() - observation.depth_mu) / observation.depth_sigma_mu;
    error.chi2 += error.depth * error.depth;
  }
  return error;
}

using PoseEquations = NormalEquations<6>;

// Adds one observation to the normal equations of the pose, with the Huber weight for its Chi2Bound. Parameters:
// translation, then rotation of the camera's frame (see ApplyStep).
void AddObservation(const CameraModel& camera, const CameraFromWorld& pose, const PoseObservation& observation,
                    PoseEquations& equations);

// p_camera' = Exp(rotation) * p_camera + translation, with step = (translation, rotation).
CameraFromWorld ApplyStep(const CameraFromWorld& pose, const PoseEquations::Vector& step);

}  // namespace romap::slam
