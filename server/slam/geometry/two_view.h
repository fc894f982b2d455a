#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/camera_model.h"
#include "common/geometry.h"

namespace romap::slam {

struct TwoViewMatch {
  Eigen::Vector2d first_px = Eigen::Vector2d::Zero();  // undistorted
  Eigen::Vector2d second_px = Eigen::Vector2d::Zero();
  // Standard deviation per axis of the less accurate of the two pixels. If it is too large, the smaller scatter of the
  // matches is used instead; if it is too small, good matches are rejected.
  double sigma_px = 1;
};

enum class TwoViewOutcome {
  kOk,
  kTooFewMatches,      // fewer than min_matches, or fewer than min_points inliers of the best model
  kTooLittleParallax,  // a pure rotation explains the matches, rays are nearly parallel, or the motion is too uncertain
  kAmbiguous,          // two motions explain the matches about equally well
};

struct TwoViewOptions {
  int min_matches = 80;
  int min_points = 50;            // triangulated, in front of both cameras, with small reprojection errors
  double min_parallax_deg = 1.5;  // median over all agreeing matches, including those of distant points
  // A pure rotation is assumed if its support exceeds this share of the best motion's support.
  double max_rotation_support_ratio = 0.6;
  // The result is ambiguous if the support of another motion exceeds this share of the best motion's support.
  double max_second_best_ratio = 0.88;
  // Standard deviations from the covariance of the refined motion, along its least certain axis.
  double max_rotation_sigma_deg = 0.8;
  double max_direction_sigma_deg = 3;
  int max_iterations = 200;  // RANSAC
  uint64_t seed = 1;
};

struct TwoViewResult {
  TwoViewOutcome outcome = TwoViewOutcome::kTooFewMatches;
  bool from_homography = false;        // the homography fits about as well: the scene is nearly planar
  SE3<Camera, Camera> T_first_second;  // second camera to first camera; |translation| = 1
  std::vector<std::optional<Eigen::Vector3d>> points_first;  // per match: in the first camera's frame, if usable
  int points = 0;
  double parallax_rad = 0;  // median over the agreeing matches
};

// Structure and motion from two views of one calibrated camera, without a prior. RANSAC fits a homography and an
// essential matrix to the same samples (as Mur-Artal et al., 2015, section IV, but with the five-point method of Nister
// 2004 instead of eight points, because it also works for planes and tolerates more outliers). The motions of both
// models (homography: Malis and Vargas 2007) are refined. The outcome is kOk for the motion with the most agreeing
// matches in front of both cameras, unless a pure rotation or another motion explains the matches nearly as well, or
// the motion is too uncertain.
TwoViewResult SolveTwoView(const CameraModel& camera, std::span<const TwoViewMatch> matches,
                           const TwoViewOptions& options);

// A short text for users, for example "too little parallax: the camera did not move or only rotated".
const char* Describe(TwoViewOutcome outcome);

}  // namespace romap::slam
