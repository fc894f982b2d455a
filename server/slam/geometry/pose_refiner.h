#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "common/camera_model.h"
#include "common/geometry.h"

namespace romap::slam {

// An observation of a known point.
struct PoseObservation {
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();   // map units
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();  // undistorted
  double sigma_px = 1;                                 // standard deviation per axis
  double depth_mu = 0;                                 // measured z depth, 0 = unknown
  double depth_sigma_mu = 0;                           // its standard deviation
};

struct PoseEstimate {
  SE3<World, Camera> T_world_camera;
  std::vector<uint8_t> inlier;  // per observation: within the 95 % bound, and in front of the camera
  int inliers = 0;
  double rms_px = 0;  // of the inliers' reprojection errors
};

struct PoseRefinerOptions {
  int rounds = 3;                // outliers are reselected before every round except the first
  int iterations_per_round = 5;  // of Gauss-Newton (Levenberg-Marquardt)
  // Also selects outliers before the first round: for an accurate start pose and many wrong matches.
  bool start_is_close = false;
};

// Refines the camera pose by robust (Huber) Levenberg-Marquardt on the reprojection (and depth) errors of known points.
// Six parameters; the chi-square bound rejects outliers (5.991 without depth, 7.815 with depth). It runs twice per
// frame, so no loop allocates memory and the normal equations are accumulated directly. With fewer than 4 usable
// observations the result has no inliers.
PoseEstimate RefinePose(const CameraModel& camera, const SE3<World, Camera>& start,
                        std::span<const PoseObservation> observations, const PoseRefinerOptions& options = {});

}  // namespace romap::slam
