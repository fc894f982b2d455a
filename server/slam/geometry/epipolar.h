#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "common/camera_model.h"
#include "server/slam/geometry/levenberg_marquardt.h"
#include "server/slam/geometry/two_view.h"

namespace romap::slam {

// A match as two rays with z = 1, each in the frame of its camera.
struct RayMatch {
  Eigen::Vector3d first;
  Eigen::Vector3d second;
  double sigma_px = 1;
};

std::vector<RayMatch> ToRays(const CameraModel& camera, std::span<const TwoViewMatch> matches);

// Relative motion of the camera, up to scale: p_second = rotation * p_first + direction * (unknown length > 0).
struct Motion {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  // unit length

  Eigen::Matrix3d Essential() const;
};

// Median distance of the matches from their epipolar lines. `matches` must not be empty.
double MedianEpipolarDistance_px(const CameraModel& camera, const Motion& motion, std::span<const RayMatch> matches);

// 95 % bound of chi-square with one degree of freedom: a match is one constraint on a motion.
inline constexpr double kEpipolarChi2Bound = 3.841;

// First-order approximation (Sampson 1982) of the squared distance from a match to the nearest match that satisfies the
// epipolar constraint, in units of the match's variance.
double SampsonChi2(const CameraModel& camera, const Eigen::Matrix3d& essential, const RayMatch& match);

// The nearest match that satisfies the epipolar constraint to first order, so that its rays intersect.
RayMatch ClosestEpipolarMatch(const CameraModel& camera, const Eigen::Matrix3d& essential, const RayMatch& match);

// Intersection of the two rays of a match for a given motion.
struct RayIntersection {
  double first_depth = 0;   // z in the first camera, in units of the distance between the cameras
  double second_depth = 0;  // z in the second camera
  double parallax_rad = 0;  // angle between the rays
  // True if the angle clearly exceeds the pixel noise, so that the depths and their signs are reliable.
  bool is_significant = false;

  bool IsInFrontOfBoth() const { return first_depth > 0 && second_depth > 0; }
};

RayIntersection Intersect(const CameraModel& camera, const Motion& motion, const RayMatch& match);

// Number of matches that agree with a motion, each weighted from 1 (exact) to 0 (at the bound), as in MSAC (Torr and
// Zisserman 2000). Points behind a camera do not count.
double Support(const CameraModel& camera, const Motion& motion, std::span<const RayMatch> matches);

using MotionEquations = NormalEquations<5>;

// Normal equations of the Sampson errors of the matches, with Huber weights. For the parameters, see ApplyStep.
MotionEquations EpipolarEquations(const CameraModel& camera, const Motion& motion, std::span<const RayMatch> matches);

// step = (rotation of the second camera's frame [rad], shift of the direction along two axes perpendicular to it).
Motion ApplyStep(const Motion& motion, const MotionEquations::Vector& step);

// A motion that was fitted to its inliers, with its uncertainty.
struct RefinedMotion {
  Motion motion;
  double support = 0;              // of all matches
  double rotation_sigma_rad = 0;   // standard deviation about the least certain axis
  double direction_sigma_rad = 0;  // of the direction, along its least certain axis
};

// Two-view bundle adjustment without explicit points: minimizes the Sampson errors of the matches within the bound over
// the five parameters of the motion. Repeats the selection of these matches in a few rounds.
RefinedMotion RefineMotion(const CameraModel& camera, const Motion& start, std::span<const RayMatch> matches);

}  // namespace romap::slam
