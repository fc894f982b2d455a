#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace romap::objects {

// Yaw of the main axis of points as seen from above, in [-pi/2, pi/2] from the x axis of their frame, whose z axis is
// up. Distant points have a low weight (the scatter matrix of a multivariate Cauchy distribution), so that a few
// outliers do not rotate it. nullopt for fewer than eight points, and when they are spread about evenly in all
// directions. Source: the paper's section on pose and size, its simple method; D. Kent, D. Tyler, "Redescending
// M-estimates of multivariate location and scatter", Annals of Statistics 1991.
std::optional<double> PcaYaw(std::span<const Eigen::Vector3d> points);

}  // namespace romap::objects
