#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "common/camera_model.h"
#include "common/pose_uncertainty.h"
#include "server/slam/geometry/pose_refiner.h"

namespace romap::slam {

// Covariance of a pose that RefinePose() found, for exact points: the inverse of the information of its inliers
// (Hartley and Zisserman 2004, section 5.2.4), times the variance of their errors relative to the claimed one. Rows and
// columns: position of the camera along its axes [mu], then the rotation vector about these axes [rad]. nullopt: the
// inliers do not determine the pose.
std::optional<Eigen::Matrix<double, 6, 6>> PoseCovariance(const CameraModel& camera, const PoseEstimate& estimate,
                                                          std::span<const PoseObservation> observations);

// The standard deviation of PoseUncertainty for an error with this covariance: the 95 % quantile of its length, by the
// chi-square distribution with the same mean and variance (Satterthwaite 1946) and the approximation by Wilson and
// Hilferty 1931, over kSigmasTo95. Accurate to 2 %.
double EquivalentSigma(const Eigen::Matrix3d& covariance);

}  // namespace romap::slam
