#pragma once

#include <cmath>

namespace romap {

// The 95 % quantile of the length of a vector of three independent normal errors with standard deviation 1: the square
// root of the 95 % quantile of the chi-square distribution with 3 degrees of freedom.
inline constexpr double kSigmasTo95 = 2.7955;

// How far an estimated camera pose may be from the true one. 95 % of the distances between estimated and true position
// are expected to be below kSigmasTo95 * position_sigma_mu, and 95 % of the angles between estimated and true
// orientation below kSigmasTo95 * rotation_sigma_rad. If the errors are alike along all axes, these are the standard
// deviations per axis. The estimate is compared after the trajectory is aligned with the true one by the similarity
// that fits best (with depth images: by a rigid motion), because a map from images has a world of its own.
struct PoseUncertainty {
  double position_sigma_mu = 0;
  double rotation_sigma_rad = 0;

  bool operator==(const PoseUncertainty&) const = default;
};

// The uncertainty of a pose with two independent sources of errors.
inline PoseUncertainty Combine(const PoseUncertainty& a, const PoseUncertainty& b) {
  return {std::hypot(a.position_sigma_mu, b.position_sigma_mu), std::hypot(a.rotation_sigma_rad, b.rotation_sigma_rad)};
}

}  // namespace romap
