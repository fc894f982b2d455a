#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "common/camera_model.h"
#include "server/slam/geometry/levenberg_marquardt.h"
#include "server/slam/geometry/two_view.h"

namespace romap::slam {

// A match as rays with z = 1, each in its camera's frame.
struct RayMatch {
  Eigen::Vector3d first;
  Eigen::Vector3d second;
  double sigma_px = 1;
};

std::vector<RayMatch> RaysOf(const CameraModel& camera, std::span<const TwoViewMatch> matches);

// How the camera moved, up to scale: p_second = rotation * p_first + direction * (unknown length > 0).
struct Motion {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  // unit length

  Eigen::Matrix3d Essential() const;
};

// 95 % bound of chi-square with one degree of freedom: a match is one constraint on a motion.
inline constexpr double kEpipolarChi2Bound = 3.841;

// Squared distance of a match to the nearest that obeys `essential`, to first order (Sampson 1982), in units of its
// variance.
double SampsonChi2(const CameraModel& camera, const Eigen::Matrix3d& essential, const RayMatch& match);

// The match nearest to `match` that obeys `essential`, to first order: its rays meet.
RayMatch NearestObedient(const CameraModel& camera, const Eigen::Matrix3d& essential, const RayMatch& match);

// Where the rays of a match meet, given a motion.
struct RayMeeting {
  double first_depth = 0;   // z in the first camera, in units of the distance between the cameras
  double second_depth = 0;  // z in the second camera
  double parallax_rad = 0;  // angle between the rays
  // The angle is larger than the noise of the pixels, so that depth and its sign are significant.
  bool is_significant = false;

  bool IsBeforeBoth() const { return first_depth > 0 && second_depth > 0; }
};

RayMeeting MeetingOf(const CameraModel& camera, const Motion& motion, const RayMatch& match);

// Number of matches that a motion explains, each weighted by how well (1 = exactly, 0 = at the bound, as in MSAC, Torr
// and Zisserman 2000), matches behind a camera do not count.
double Support(const CameraModel& camera, const Motion& motion, std::span<const RayMatch> matches);

using MotionEquations = NormalEquations<5>;

// The Sampson errors of the matches, with Huber's weight. Parameters as in Moved.
MotionEquations EpipolarEquations(const CameraModel& camera, const Motion& motion, std::span<const RayMatch> matches);

// step = (turn of the second camera's frame, shift of the direction along two axes across it).
Motion Moved(const Motion& motion, const MotionEquations::Vector& step);

// A motion that was fitted to its inliers, with its uncertainty.
struct RefinedMotion {
  Motion motion;
  double support = 0;              // of all matches
  double rotation_sigma_rad = 0;   // standard deviation about the least certain axis
  double direction_sigma_rad = 0;  // of the direction, in its least certain direction
};

// Two-view bundle adjustment with the points eliminated: the Sampson errors of the matches within the bound, which
// are selected again a few times, over the five parameters of the motion.
RefinedMotion RefineMotion(const CameraModel& camera, const Motion& start, std::span<const RayMatch> matches);

}  // namespace romap::slam
