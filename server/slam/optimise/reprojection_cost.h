#pragma once

#include <ceres/sized_cost_function.h>

#include <Eigen/Core>

#include "common/camera_model.h"
#include "server/slam/optimise/bundle_adjustment.h"
#include "server/slam/optimise/bundle_state.h"

namespace romap {

// Residuals of bundle adjustment, each divided by its standard deviation, with analytic Jacobians. Parameters: the
// camera's increment (6, see CameraState) and the point (3, world). Each reads its camera's state, which must have been
// refreshed for the increment and must outlive the cost. Lengths are those of the optimisation.

// A point nearer to the image plane than this has no image to speak of: its residual is a constant large one without
// Jacobian, so that a step that takes a point behind a camera costs, but does not fail.
inline constexpr double kMinBundleDepth = 1e-3;

// Pixel error (x, y).
class ReprojectionCost final : public ceres::SizedCostFunction<2, 6, 3> {
 public:
  ReprojectionCost(const CameraModel& camera, const CameraState* state, const Eigen::Vector2d& pixel_px,
                   double sigma_px);

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  const CameraState* state_;
  double measured_x_, measured_y_;  // x / z and y / z
  double weight_x_, weight_y_;      // focal length / sigma
};

// Pixel error (x, y) and error of the inverse depth.
class ReprojectionDepthCost final : public ceres::SizedCostFunction<3, 6, 3> {
 public:
  ReprojectionDepthCost(const CameraModel& camera, const CameraState* state, const Eigen::Vector2d& pixel_px,
                        double sigma_px, double depth, double depth_sigma);

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  ReprojectionCost reprojection_;
  const CameraState* state_;
  double measured_;  // 1 / depth
  double weight_;    // 1 / sigma of the inverse depth
};

// Distance from a prior: rotation vector from the prior to the camera, then translation.
class PosePriorCost final : public ceres::SizedCostFunction<6, 6> {
 public:
  PosePriorCost(const CameraState* state, const PosePrior& prior);

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  const CameraState* state_;
  PosePrior prior_;
};

}  // namespace romap
