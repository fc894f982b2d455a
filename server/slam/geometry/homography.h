#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "server/slam/geometry/epipolar.h"

namespace romap::slam {

// 95 % bound of chi-square with two degrees of freedom: a match says two things about a homography or a turn.
inline constexpr double kTransferChi2Bound = 5.991;

// The homography, second ~ H * first on rays, that fits at least four matches best in the algebraic sense (direct
// linear transformation; Hartley and Zisserman, algorithm 4.1; rays are as good as normalised pixels). nullopt:
// degenerate.
std::optional<Eigen::Matrix3d> FitHomography(std::span<const RayMatch> matches);

// The larger of the squared transfer errors first -> second and second -> first, in units of the match's variance;
// infinite where a ray leaves the picture plane. `inverse` is that of `homography`.
double TransferChi2(const CameraModel& camera, const Eigen::Matrix3d& homography, const Eigen::Matrix3d& inverse,
                    const RayMatch& match);

// How many matches a homography explains, each counted by how well (see Support of a motion).
double TransferSupport(const CameraModel& camera, const Eigen::Matrix3d& homography, std::span<const RayMatch> matches);

// Fits the homography again to the matches that it explains, for as long as that explains more.
Eigen::Matrix3d PolishHomography(const CameraModel& camera, const Eigen::Matrix3d& start,
                                 std::span<const RayMatch> matches);

// The motions of a camera before a plane that cause a homography (Malis and Vargas 2007): at most four, without a check
// of which side of the plane or of the camera the points are on. Empty for a mere turn.
std::vector<Motion> MotionsOf(const Eigen::Matrix3d& homography);

// The turn nearest to a homography, fitted to the matches that it explains: what the matches would mean had the camera
// not moved, only turned.
Eigen::Matrix3d FitTurn(const CameraModel& camera, const Eigen::Matrix3d& homography,
                        std::span<const RayMatch> matches);

}  // namespace romap::slam
