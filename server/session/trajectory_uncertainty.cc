#include "server/session/trajectory_uncertainty.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace romap::session {
namespace {

constexpr double kIndependentErrors = 4;
// For the rotation, whose errors cancel where those of neighboring frames are alike.
constexpr double kIndependentMoments = 16;
// Of PoseUncertainty: an error about a single axis is below 1.96 sigmas in 95 % of the cases.
constexpr double kSigmaOfOneAxis = 1.96 / kSigmasTo95;
constexpr double kMaxTurn_rad = 1;

// Root mean square distance of the positions from the line through them.
double DistanceFromLine_mu(std::span<const FrameUncertainty> frames) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const FrameUncertainty& frame : frames) mean += frame.position_world / static_cast<double>(frames.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const FrameUncertainty& frame : frames) {
    const Eigen::Vector3d offset = frame.position_world - mean;
    scatter += offset * offset.transpose() / static_cast<double>(frames.size());
  }
  const Eigen::Vector3d variances = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvalues();
  return std::sqrt(std::max(0.0, variances[0] + variances[1]));
}

// Uncertainty of the rotation of an alignment by positions with errors of root mean square `position_sigma_mu`.
double TurnSigma_rad(double position_sigma_mu, double distance_from_line_mu) {
  const double sigma_mu = kSigmaOfOneAxis * position_sigma_mu / std::sqrt(kIndependentMoments);
  return sigma_mu < kMaxTurn_rad * distance_from_line_mu ? sigma_mu / distance_from_line_mu : kMaxTurn_rad;
}

}  // namespace

std::vector<PoseUncertainty> AlignedUncertainties(std::span<const FrameUncertainty> frames) {
  PoseUncertainty sum_of_squares;
  for (const FrameUncertainty& frame : frames) {
    sum_of_squares.position_sigma_mu += std::pow(frame.relative.position_sigma_mu, 2);
    sum_of_squares.rotation_sigma_rad += std::pow(frame.relative.rotation_sigma_rad, 2);
  }
  const double rms_mu = std::sqrt(sum_of_squares.position_sigma_mu / static_cast<double>(frames.size()));
  const double turn_rad = frames.size() < 3 || rms_mu == 0 ? 0 : TurnSigma_rad(rms_mu, DistanceFromLine_mu(frames));
  const double count = kIndependentErrors * static_cast<double>(frames.size());
  const PoseUncertainty alignment{std::sqrt(sum_of_squares.position_sigma_mu / count),
                                  std::hypot(std::sqrt(sum_of_squares.rotation_sigma_rad / count), turn_rad)};
  std::vector<PoseUncertainty> aligned;
  aligned.reserve(frames.size());
  for (const FrameUncertainty& frame : frames) {
    aligned.push_back(Combine(Combine(frame.reference, frame.relative), alignment));
  }
  return aligned;
}

}  // namespace romap::session
