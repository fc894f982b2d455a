#include "server/slam/geometry/plane_fit.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>

namespace romap::slam {
namespace {

// Minimum ratio of height to base of a triangle with a usable normal.
constexpr double kMinTriangleHeight = 0.1;
// Minimum spread of the points across their main axis, relative to the spread along it.
constexpr double kMinSpreadRatio = 1e-3;

}  // namespace

std::optional<Plane> PlaneThrough(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d cross = (b - a).cross(c - a);
  const double longest_squared = std::max({(b - a).squaredNorm(), (c - a).squaredNorm(), (c - b).squaredNorm()});
  // Twice the area over the square of the longest side.
  if (!(cross.norm() > kMinTriangleHeight * longest_squared)) return std::nullopt;
  const Eigen::Vector3d normal = cross.normalized();
  return Plane{normal, normal.dot(a)};
}

std::optional<PlaneFit> FitPlane(std::span<const Eigen::Vector3d> points, std::span<const double> weights,
                                 const Eigen::Vector3d& up) {
  double total = 0;
  int used = 0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < points.size(); ++i) {
    total += weights[i];
    used += weights[i] > 0;
    mean += weights[i] * points[i];
  }
  if (used < 4) return std::nullopt;
  mean /= total;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d from_mean = points[i] - mean;
    spread += weights[i] / total * from_mean * from_mean.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread);  // ascending
  const Eigen::Vector3d& spreads = axes.eigenvalues();
  if (!(spreads[1] > kMinSpreadRatio * kMinSpreadRatio * spreads[2])) return std::nullopt;

  PlaneFit fit;
  fit.plane.normal = axes.eigenvectors().col(0);
  if (fit.plane.normal.dot(up) < 0) fit.plane.normal = -fit.plane.normal;
  fit.plane.offset_mu = fit.plane.normal.dot(mean);
  // The tilt toward an in-plane axis is the slope of the heights along it: a separate one-parameter fit, because the
  // axes are the principal ones.
  double variance = 0;
  for (int axis = 1; axis < 3; ++axis) {
    double noise = 0;
    for (size_t i = 0; i < points.size(); ++i) {
      const double along = axes.eigenvectors().col(axis).dot(points[i] - mean);
      noise += std::pow(weights[i] / total * along * fit.plane.Height(points[i]), 2);
    }
    variance += noise / (spreads[axis] * spreads[axis]);
  }
  fit.sigma_rad = std::sqrt(variance);
  return fit;
}

}  // namespace romap::slam
