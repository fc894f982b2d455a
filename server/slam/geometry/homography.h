#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "server/slam/geometry/epipolar.h"

namespace romap::slam {

// 95 % bound of chi-square with two degrees of freedom: a match is two constraints on a homography or a rotation.
inline constexpr double kTransferChi2Bound = 5.991;

// The homography, second ~ H * first on rays, that fits at least four matches best in the algebraic sense (direct
// linear transformation; Hartley and Zisserman, algorithm 4.1; rays are as good as normalized pixels). nullopt:
// degenerate.
std::optional<Eigen::Matrix3d> FitHomography(std::span<const RayMatch> matches);

// The larger of the squared transfer errors first -> second and second -> first, in units of the match's variance;
// infinite where a ray is parallel to the image plane. `inverse` is that of `homography`.
double TransferChi2(const CameraModel& camera, const Eigen::Matrix3d& homography, const Eigen::Matrix3d& inverse,
                    const RayMatch& match);

// Number of matches that a homography explains, each weighted by how well (see Support of a motion).
double TransferSupport(const CameraModel& camera, const Eigen::Matrix3d& homography, std::span<const RayMatch> matches);

// Fits the homography again to the matches that it explains, for as long as that explains more.
Eigen::Matrix3d PolishHomography(const CameraModel& camera, const Eigen::Matrix3d& start,
                                 std::span<const RayMatch> matches);

// The motions of a camera before a plane that cause a homography (Malis and Vargas 2007): at most four, without a check
// of which side of the plane or of the camera the points are on. Empty for a pure rotation.
std::vector<Motion> MotionsOf(const Eigen::Matrix3d& homography);

// The rotation closest to a homography, fitted to the matches that it explains: the motion if the camera only rotated.
Eigen::Matrix3d FitTurn(const CameraModel& camera, const Eigen::Matrix3d& homography,
                        std::span<const RayMatch> matches);

}  // namespace romap::slam
