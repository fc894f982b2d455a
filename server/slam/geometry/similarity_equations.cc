#include "server/slam/geometry/similarity_equations.h"

#include <cmath>

#include "server/slam/geometry/rotation.h"

namespace romap::slam {
namespace {

// Cost of a match that a step moves behind a camera; see reprojection.cc.
constexpr double kPenaltyBehindCamera = 1e4;
// Keeps the normal equations nonsingular if the scale is fixed.
constexpr double kFixedScaleInformation = 1;

using PointDerivative = Eigen::Matrix<double, 3, 7>;

// Derivative of the pixel with respect to the point, divided by the standard deviation.
Eigen::Matrix<double, 2, 3> ProjectionDerivative(const CameraModel& camera, const Eigen::Vector3d& p, double sigma_px) {
  const double inverse_z = 1 / p.z();
  const double fx = camera.fx_px * inverse_z / sigma_px;
  const double fy = camera.fy_px * inverse_z / sigma_px;
  Eigen::Matrix<double, 2, 3> derivative;
  derivative << fx, 0, -fx * p.x() * inverse_z, 0, fy, -fy * p.y() * inverse_z;
  return derivative;
}

void AddPixel(const Eigen::Matrix<double, 2, 7>& derivative, const Eigen::Vector2d& error, double bound,
              SimilarityEquations& equations) {
  const double chi2 = error.squaredNorm();
  const double weight = HuberWeight(chi2, bound);
  for (int row = 0; row < 2; ++row) equations.Add(derivative.row(row).transpose(), error[row], weight);
  equations.cost += HuberCost(chi2, bound);
}

}  // namespace

SimilarityErrors ErrorsOf(const CameraModel& camera, const Similarity& similarity, const SimilarityMatch& match) {
  SimilarityErrors errors;
  errors.second_in_first = similarity.scale * (similarity.rotation * match.p_second) + similarity.translation;
  errors.first_in_second =
      similarity.rotation.transpose() * (match.p_first - similarity.translation) / similarity.scale;
  errors.is_in_front_of_both = errors.second_in_first.z() > 0 && errors.first_in_second.z() > 0;
  if (!errors.is_in_front_of_both) return errors;
  errors.first = (camera.Project(errors.second_in_first) - match.first_px) / match.first_sigma_px;
  errors.second = (camera.Project(errors.first_in_second) - match.second_px) / match.second_sigma_px;
  return errors;
}

void AddSimilarityErrors(const CameraModel& camera, const Similarity& similarity, const SimilarityMatch& match,
                         const SimilarityOptions& options, SimilarityEquations& equations) {
  const SimilarityErrors errors = ErrorsOf(camera, similarity, match);
  if (!errors.is_in_front_of_both) {
    equations.cost += kPenaltyBehindCamera;
    return;
  }
  // The step moves the second camera's point in the first camera's frame. The inverse of the step moves the first
  // camera's point.
  PointDerivative moved_first;
  moved_first << Eigen::Matrix3d::Identity(), -Skew(errors.second_in_first), errors.second_in_first;
  PointDerivative moved_back;
  moved_back << Eigen::Matrix3d::Identity(), -Skew(match.p_first), match.p_first;
  PointDerivative moved_second = -similarity.rotation.transpose() * moved_back / similarity.scale;
  if (options.fix_scale) {
    moved_first.col(6).setZero();
    moved_second.col(6).setZero();
    equations.hessian(6, 6) += kFixedScaleInformation;
  }
  AddPixel(ProjectionDerivative(camera, errors.second_in_first, match.first_sigma_px) * moved_first, errors.first,
           options.chi2_bound, equations);
  AddPixel(ProjectionDerivative(camera, errors.first_in_second, match.second_sigma_px) * moved_second, errors.second,
           options.chi2_bound, equations);
}

Similarity ApplySimilarityStep(const Similarity& similarity, const SimilarityEquations::Vector& step) {
  const double scale = std::exp(step[6]);
  const Eigen::Matrix3d rotation = ExpRotationMatrix(step.segment<3>(3));
  return {scale * similarity.scale, rotation * similarity.rotation,
          scale * (rotation * similarity.translation) + step.head<3>()};
}

}  // namespace romap::slam
