#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace romap::slam {

// An observation of a point: a ray with its uncertainty and, with a depth image, the distance to the point.
struct ObservedRay {
  Eigen::Vector3d center_world = Eigen::Vector3d::Zero();    // of the camera, map units
  Eigen::Vector3d bearing_world = Eigen::Vector3d::UnitZ();  // unit length, from the camera to the point
  double bearing_sigma_rad = 1e-3;                           // standard deviation across the ray, per axis
  double range_mu = 0;                                       // distance along the ray, 0 = unknown
  double range_sigma_mu = 0;                                 // its standard deviation
};

// The 95 % bound of a squared, normalized bearing error (two degrees of freedom).
inline constexpr double kBearingChi2Bound = 5.991;

// Squared error of the bearing in units of its variance; infinite for a point behind the camera.
double BearingChi2(const ObservedRay& ray, const Eigen::Vector3d& p_world);

// Whether the point agrees with the ray within the 95 % bound of its bearing and three sigmas of its range.
bool Agrees(const ObservedRay& ray, const Eigen::Vector3d& p_world);

// Angle between the rays from two camera centers to a point.
double Parallax_rad(const ObservedRay& a, const ObservedRay& b, const Eigen::Vector3d& p_world);

// The point closest to two rays (midpoint method). nullopt: the rays are parallel, or the point is behind a camera.
std::optional<Eigen::Vector3d> IntersectRays(const ObservedRay& a, const ObservedRay& b);

// The point that fits all rays best: Gauss-Newton on the errors of bearings and ranges with Huber weights (at the
// bounds above), with constant poses. Starts at `p_world` and returns it if no step reduces the cost.
Eigen::Vector3d RefinePoint(const std::vector<ObservedRay>& rays, const Eigen::Vector3d& p_world);

}  // namespace romap::slam
