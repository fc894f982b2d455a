#include "server/slam/geometry/epipolar.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "common/statistics.h"
#include "server/slam/geometry/rotation.h"

namespace romap::slam {
namespace {

constexpr int kRefineRounds = 4;
constexpr int kIterationsPerRound = 6;
// The first round accepts larger errors by this factor, because the start was computed from only five noisy matches.
constexpr double kFirstRoundBoundFactor = 4;
// Minimum ratio of the parallax to the angular pixel noise. At this ratio, the depth is accurate to about a third.
constexpr double kSignificantParallax = 4;

// The epipolar constraint of one match and its derivatives.
struct EpipolarLines {
  double algebraic = 0;          // second^T * E * first
  Eigen::Vector3d first_slope;   // derivative by the first pixel, divided by the focal lengths (rays per px)
  Eigen::Vector3d second_slope;  // the same for the second pixel
  double slope2 = 0;             // squared norm of the derivative with respect to all four pixel coordinates
};

EpipolarLines ComputeLines(const CameraModel& camera, const Eigen::Matrix3d& essential, const RayMatch& match) {
  EpipolarLines lines;
  const Eigen::Vector3d second_line = essential * match.first;
  const Eigen::Vector3d first_line = essential.transpose() * match.second;
  const Eigen::Array3d inverse_focal2(1 / (camera.fx_px * camera.fx_px), 1 / (camera.fy_px * camera.fy_px), 0);
  lines.algebraic = match.second.dot(second_line);
  lines.first_slope = first_line.array() * inverse_focal2;
  lines.second_slope = second_line.array() * inverse_focal2;
  lines.slope2 = lines.first_slope.dot(first_line) + lines.second_slope.dot(second_line);
  return lines;
}

// Two unit vectors that are perpendicular to `direction` and to each other.
Eigen::Matrix<double, 3, 2> PerpendicularAxes(const Eigen::Vector3d& direction) {
  Eigen::Matrix<double, 3, 2> axes;
  axes.col(0) = direction.unitOrthogonal();
  axes.col(1) = direction.cross(axes.col(0));
  return axes;
}

// Derivatives of the essential matrix with respect to the parameters of ApplyStep.
std::array<Eigen::Matrix3d, 5> EssentialDerivatives(const Motion& motion) {
  std::array<Eigen::Matrix3d, 5> derivatives;
  for (int k = 0; k < 3; ++k) {
    derivatives[k] = Skew(motion.direction) * Skew(Eigen::Vector3d::Unit(k)) * motion.rotation;
  }
  const Eigen::Matrix<double, 3, 2> axes = PerpendicularAxes(motion.direction);
  for (int k = 0; k < 2; ++k) derivatives[3 + k] = Skew(axes.col(k)) * motion.rotation;
  return derivatives;
}

double AngleSigma_rad(const Eigen::MatrixXd& covariance) {
  const double largest = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(covariance).eigenvalues().maxCoeff();
  return largest >= 0 ? std::sqrt(largest) : std::numeric_limits<double>::infinity();
}

// Computes the standard deviations from the information matrix of the inliers, scaled up if the residuals exceed the
// given noise.
void SetSigmas(const MotionEquations& equations, int inliers, RefinedMotion& refined) {
  refined.rotation_sigma_rad = refined.direction_sigma_rad = std::numeric_limits<double>::infinity();
  const Eigen::LDLT<MotionEquations::Matrix> information(equations.hessian);
  if (inliers <= 5 || !information.isPositive() || !(information.rcond() > 1e-14)) return;
  const double noise = std::max(1.0, equations.cost / (inliers - 5));
  const MotionEquations::Matrix covariance = noise * information.solve(MotionEquations::Matrix::Identity());
  refined.rotation_sigma_rad = AngleSigma_rad(covariance.topLeftCorner<3, 3>());
  refined.direction_sigma_rad = AngleSigma_rad(covariance.bottomRightCorner<2, 2>());
}

}  // namespace

std::vector<RayMatch> ToRays(const CameraModel& camera, std::span<const TwoViewMatch> matches) {
  std::vector<RayMatch> rays;
  rays.reserve(matches.size());
  for (const TwoViewMatch& match : matches) {
    rays.push_back({camera.Unproject(match.first_px.x(), match.first_px.y()),
                    camera.Unproject(match.second_px.x(), match.second_px.y()), match.sigma_px});
  }
  return rays;
}

Eigen::Matrix3d Motion::Essential() const { return Skew(direction) * rotation; }

double SampsonChi2(const CameraModel& camera, const Eigen::Matrix3d& essential, const RayMatch& match) {
  const EpipolarLines lines = ComputeLines(camera, essential, match);
  return lines.algebraic * lines.algebraic / (lines.slope2 * match.sigma_px * match.sigma_px);
}

double MedianEpipolarDistance_px(const CameraModel& camera, const Motion& motion, std::span<const RayMatch> matches) {
  const Eigen::Matrix3d essential = motion.Essential();
  std::vector<double> distances_px;
  for (const RayMatch& match : matches) {
    distances_px.push_back(match.sigma_px * std::sqrt(SampsonChi2(camera, essential, match)));
  }
  return Median(std::move(distances_px));
}

RayMatch ClosestEpipolarMatch(const CameraModel& camera, const Eigen::Matrix3d& essential, const RayMatch& match) {
  const EpipolarLines lines = ComputeLines(camera, essential, match);
  if (!(lines.slope2 > 0)) return match;
  const double shift = lines.algebraic / lines.slope2;
  RayMatch corrected = match;
  corrected.first -= shift * lines.first_slope;
  corrected.second -= shift * lines.second_slope;
  return corrected;
}

RayIntersection Intersect(const CameraModel& camera, const Motion& motion, const RayMatch& match) {
  const Eigen::Vector3d first_rotated = motion.rotation * match.first;
  const Eigen::Vector3d normal = first_rotated.cross(match.second);
  const double normal2 = normal.squaredNorm();
  RayIntersection intersection;
  intersection.parallax_rad = std::atan2(std::sqrt(normal2), first_rotated.dot(match.second));
  intersection.is_significant = intersection.parallax_rad > kSignificantParallax * match.sigma_px / camera.fx_px;
  if (normal2 == 0) return intersection;
  intersection.first_depth = -motion.direction.cross(match.second).dot(normal) / normal2;
  intersection.second_depth = -motion.direction.cross(first_rotated).dot(normal) / normal2;
  return intersection;
}

double Support(const CameraModel& camera, const Motion& motion, std::span<const RayMatch> matches) {
  const Eigen::Matrix3d essential = motion.Essential();
  double support = 0;
  for (const RayMatch& match : matches) {
    const double chi2 = SampsonChi2(camera, essential, match);
    if (!(chi2 < kEpipolarChi2Bound)) continue;
    const RayIntersection intersection = Intersect(camera, motion, match);
    if (!intersection.is_significant || intersection.IsInFrontOfBoth()) support += 1 - chi2 / kEpipolarChi2Bound;
  }
  return support;
}

MotionEquations EpipolarEquations(const CameraModel& camera, const Motion& motion, std::span<const RayMatch> matches) {
  const Eigen::Matrix3d essential = motion.Essential();
  const std::array<Eigen::Matrix3d, 5> derivatives = EssentialDerivatives(motion);
  MotionEquations equations;
  for (const RayMatch& match : matches) {
    const EpipolarLines lines = ComputeLines(camera, essential, match);
    if (!(lines.slope2 > 0)) continue;  // both points are at the epipoles and give no constraint
    const double scale = 1 / (std::sqrt(lines.slope2) * match.sigma_px);
    const double error = lines.algebraic * scale;
    MotionEquations::Vector derivative;
    for (int k = 0; k < 5; ++k) {
      const Eigen::Vector3d second_line = derivatives[k] * match.first;
      const Eigen::Vector3d first_line = derivatives[k].transpose() * match.second;
      const double half_slope2 = second_line.dot(lines.second_slope) + first_line.dot(lines.first_slope);
      derivative[k] = scale * (match.second.dot(second_line) - lines.algebraic / lines.slope2 * half_slope2);
    }
    equations.Add(derivative, error, HuberWeight(error * error, kEpipolarChi2Bound));
    equations.cost += HuberCost(error * error, kEpipolarChi2Bound);
  }
  return equations;
}

Motion ApplyStep(const Motion& motion, const MotionEquations::Vector& step) {
  return {ExpRotationMatrix(step.head<3>()) * motion.rotation,
          (motion.direction + PerpendicularAxes(motion.direction) * step.tail<2>()).normalized()};
}

RefinedMotion RefineMotion(const CameraModel& camera, const Motion& start, std::span<const RayMatch> matches) {
  RefinedMotion refined{.motion = start};
  std::vector<RayMatch> inliers;
  inliers.reserve(matches.size());
  MotionEquations equations;
  for (int round = 0; round < kRefineRounds; ++round) {
    const double bound_factor2 = round == 0 ? kFirstRoundBoundFactor * kFirstRoundBoundFactor : 1.0;
    const Eigen::Matrix3d essential = refined.motion.Essential();
    inliers.clear();
    for (const RayMatch& match : matches) {
      if (SampsonChi2(camera, essential, match) < bound_factor2 * kEpipolarChi2Bound) inliers.push_back(match);
    }
    const auto linearize = [&](const Motion& at) { return EpipolarEquations(camera, at, inliers); };
    const auto move = [](const Motion& at, const MotionEquations::Vector& step) { return ApplyStep(at, step); };
    equations = Minimize<5>(kIterationsPerRound, linearize, move, refined.motion);
  }
  // A direction and its opposite have the same Sampson errors. Choose the one with more points in front of both
  // cameras.
  const Motion opposite{refined.motion.rotation, -refined.motion.direction};
  const double opposite_support = Support(camera, opposite, matches);
  refined.support = Support(camera, refined.motion, matches);
  if (opposite_support > refined.support) {
    refined.motion = opposite;
    refined.support = opposite_support;
  }
  SetSigmas(equations, static_cast<int>(inliers.size()), refined);
  return refined;
}

}  // namespace romap::slam
