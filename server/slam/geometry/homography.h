#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "server/slam/geometry/epipolar.h"

namespace romap::slam {

// 95 % bound of chi-square with two degrees of freedom: a match is two constraints on a homography or a rotation.
inline constexpr double kTransferChi2Bound = 5.991;

// The homography with second ~ H * first (rays) that minimizes the algebraic error over at least four matches (direct
// linear transformation: Hartley and Zisserman, algorithm 4.1). Rays need no further normalization. nullopt if the
// matches are degenerate.
std::optional<Eigen::Matrix3d> FitHomography(std::span<const RayMatch> matches);

// The larger of the squared transfer errors first -> second and second -> first, in units of the match's variance;
// infinite if a transferred ray has z <= 0. `inverse` is the inverse of `homography`.
double TransferChi2(const CameraModel& camera, const Eigen::Matrix3d& homography, const Eigen::Matrix3d& inverse,
                    const RayMatch& match);

// Number of matches that agree with a homography, weighted as in Support().
double TransferSupport(const CameraModel& camera, const Eigen::Matrix3d& homography, std::span<const RayMatch> matches);

// Refits the homography to the matches that agree with it, as long as its support increases.
Eigen::Matrix3d RefineHomography(const CameraModel& camera, const Eigen::Matrix3d& start,
                                 std::span<const RayMatch> matches);

// Decomposes a homography into the camera motions in front of a plane that produce it (Malis and Vargas 2007), at most
// four. Does not check that the points are in front of the cameras. Empty for a pure rotation.
std::vector<Motion> MotionsFromHomography(const Eigen::Matrix3d& homography);

// Fits a rotation to the matches that agree with it, starting from the rotation closest to `homography`: the motion if
// the camera only rotated.
Eigen::Matrix3d FitRotation(const CameraModel& camera, const Eigen::Matrix3d& homography,
                            std::span<const RayMatch> matches);

}  // namespace romap::slam
