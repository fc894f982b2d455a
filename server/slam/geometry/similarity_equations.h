#pragma once

#include <Eigen/Core>

#include "common/camera_model.h"
#include "server/slam/geometry/levenberg_marquardt.h"
#include "server/slam/geometry/similarity.h"

namespace romap::slam {

// A similarity in the form used by the inner loops: p_first = scale * rotation * p_second + translation.
struct Similarity {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
};

// Residuals of a match for a similarity, in units of the pixels' standard deviations: the second camera's point
// projected into the first camera, and vice versa.
struct SimilarityErrors {
  Eigen::Vector3d second_in_first;  // the points, each in the other camera's frame
  Eigen::Vector3d first_in_second;
  Eigen::Vector2d first = Eigen::Vector2d::Zero();
  Eigen::Vector2d second = Eigen::Vector2d::Zero();
  bool is_in_front_of_both = false;  // false: the errors are not set
};

SimilarityErrors ErrorsOf(const CameraModel& camera, const Similarity& similarity, const SimilarityMatch& match);

using SimilarityEquations = NormalEquations<7>;

// Adds both errors of a match, each with the Huber weight for options.chi2_bound. With a fixed scale, the seventh
// parameter has no effect. For the parameters, see ApplySimilarityStep.
void AddSimilarityErrors(const CameraModel& camera, const Similarity& similarity, const SimilarityMatch& match,
                         const SimilarityOptions& options, SimilarityEquations& equations);

// p_first' = exp(log_scale) * Exp(rotation) * p_first + translation, with step = (translation, rotation, log_scale).
Similarity ApplySimilarityStep(const Similarity& similarity, const SimilarityEquations::Vector& step);

}  // namespace romap::slam
