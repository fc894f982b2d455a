#pragma once

#include <ceres/sized_cost_function.h>

#include <Eigen/Core>
#include <algorithm>

#include "common/camera_model.h"
#include "server/slam/optimize/bundle_adjustment.h"
#include "server/slam/optimize/bundle_state.h"

namespace romap::slam {

// Residuals of bundle adjustment, each divided by its standard deviation, with analytic Jacobians. Parameters: the
// camera's increment (6, see CameraState) and the point (3, world). Each cost reads the state of its camera, which must
// have been refreshed for the increment and must outlive the cost. Lengths are in the unit of the optimization.

// A point with a smaller z depth than this has no usable projection. Its residual is a large constant with zero
// Jacobian, so that a step that moves a point behind a camera is penalized but does not fail.
inline constexpr double kMinBundleDepth = 1e-3;

// Pixel error (x, y).
class ReprojectionCost final : public ceres::SizedCostFunction<2, 6, 3> {
 public:
  static constexpr int kResiduals = 2;

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
  static constexpr int kResiduals = 3;

  ReprojectionDepthCost(const CameraModel& camera, const CameraState* state, const Eigen::Vector2d& pixel_px,
                        double sigma_px, double depth, double depth_sigma);

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  ReprojectionCost reprojection_;
  const CameraState* state_;
  double measured_;  // 1 / depth
  double weight_;    // 1 / sigma of the inverse depth
};

// One of the costs above, with a third parameter: k1 of the lens (see RadialCorrection). `cost` uses the pixel of the
// uncorrected image and must outlive this object. The error is measured in the uncorrected image, because in the
// corrected image it could be reduced by shrinking that image.
template <class Cost>
class LensedCost final : public ceres::SizedCostFunction<Cost::kResiduals, 6, 3, 1> {
 public:
  LensedCost(const CameraModel& camera, const Eigen::Vector2d& observed_px, double sigma_px, const Cost* cost)
      : cost_(cost),
        observed_((observed_px.x() - camera.cx_px) / camera.fx_px, (observed_px.y() - camera.cy_px) / camera.fy_px),
        weight_(camera.fx_px / sigma_px, camera.fy_px / sigma_px) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    if (!cost_->Evaluate(parameters, residuals, jacobians)) return false;
    const double k1 = parameters[2][0];
    const Eigen::Vector2d pinhole = observed_ + Eigen::Vector2d(residuals[0], residuals[1]).cwiseQuotient(weight_);
    const double radius2 = pinhole.squaredNorm();
    const Eigen::Vector2d distortion = weight_.cwiseProduct(pinhole) * radius2;
    residuals[0] += k1 * distortion.x();
    residuals[1] += k1 * distortion.y();
    if (jacobians == nullptr) return true;
    const Eigen::Matrix2d by_pinhole =
        (1 + k1 * radius2) * Eigen::Matrix2d::Identity() + 2 * k1 * pinhole * pinhole.transpose();
    const Eigen::Matrix2d chain = weight_.asDiagonal() * by_pinhole * weight_.cwiseInverse().asDiagonal();
    ApplyChainRule<6>(chain, jacobians[0]);
    ApplyChainRule<3>(chain, jacobians[1]);
    if (jacobians[2] != nullptr) {
      std::fill_n(jacobians[2], Cost::kResiduals, 0.0);
      jacobians[2][0] = distortion.x();
      jacobians[2][1] = distortion.y();
    }
    return true;
  }

 private:
  // The first two rows are those of the pixel.
  template <int kColumns>
  static void ApplyChainRule(const Eigen::Matrix2d& chain, double* jacobian) {
    if (jacobian == nullptr) return;
    Eigen::Map<Eigen::Matrix<double, 2, kColumns, Eigen::RowMajor>> rows(jacobian);
    rows = (chain * rows).eval();
  }

  const Cost* cost_;
  Eigen::Vector2d observed_;  // in focal lengths from the principal point
  Eigen::Vector2d weight_;    // focal length / sigma
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

}  // namespace romap::slam
