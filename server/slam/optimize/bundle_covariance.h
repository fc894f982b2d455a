#pragma once

#include <Eigen/Core>
#include <vector>

#include "server/slam/optimize/bundle_adjustment.h"

namespace romap::slam {

// Covariance of an adjusted camera.
struct CameraCovariance {
  Eigen::Matrix3d position_mu2 = Eigen::Matrix3d::Zero();   // world axes
  Eigen::Matrix3d rotation_rad2 = Eigen::Matrix3d::Zero();  // of the rotation vector, world axes
};

struct BundleCovarianceOptions {
  // The larger the problem, the more redundant its cameras and points. Above these numbers an even selection stands for
  // all of them; it limits the time to about 0.1 s.
  int max_cameras = 80;
  int max_points = 1500;
};

// Covariances of the cameras of an adjusted problem, to first order: the inverse of the information of all
// observations that are not outliers, after the points (and the lens) are eliminated (Triggs et al. 1999, sections 6
// and 9). It includes what cameras and points share, e.g. the error of a baseline or a slow drift along a chain of
// cameras. The errors are those that remain after the positions of the cameras are aligned with the true ones by the
// best similarity, or by the best rigid motion if depth was observed: inner constraints, restricted to the positions.
// `fixed` is ignored. The claimed sigmas of the observations are corrected by MeasureNoise() and the degrees of
// freedom. One per camera; empty if the observations do not determine the cameras.
std::vector<CameraCovariance> BundleCovariances(const BundleProblem& problem,
                                                const BundleCovarianceOptions& options = {});

}  // namespace romap::slam
