#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace romap::slam {

// The points p with normal . p = offset; normal has unit length.
struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double offset_mu = 0;

  double Height(const Eigen::Vector3d& p) const { return normal.dot(p) - offset_mu; }
};

struct PlaneFit {
  Plane plane;
  double sigma_rad = 0;  // standard deviation of the normal's direction (root mean square angle)
};

// The plane through three points; nullopt if they are nearly collinear.
std::optional<Plane> PlaneThrough(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c);

// The plane with the least weighted sum of squared distances. The normal points to the side of `up`. weights[i] >= 0,
// in any unit, belongs to points[i]. The deviation is estimated from the distances, not from the weights (White's
// covariance estimate, 1980), so weights may express relevance as well as accuracy. nullopt: fewer than four points
// with a positive weight, or nearly collinear points.
std::optional<PlaneFit> FitPlane(std::span<const Eigen::Vector3d> points, std::span<const double> weights,
                                 const Eigen::Vector3d& up);

}  // namespace romap::slam
