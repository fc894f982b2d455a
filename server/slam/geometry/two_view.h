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
  // Standard deviation per axis of the worse of the two. May be too large, because the scatter of the
  // matches is used where it is smaller; must not be too small, or good matches are rejected.
  double sigma_px = 1;
};

enum class TwoViewOutcome {
  kOk,
  kTooFewMatches,      // fewer than min_matches, or fewer inliers than min_points under the best model
  kTooLittleParallax,  // a pure rotation explains it, rays are too close to parallel, or the motion too uncertain
  kAmbiguous,          // two motions explain the matches about equally well
};

struct TwoViewOptions {
  int min_matches = 80;
  int min_points = 50;            // triangulated, in front of both cameras, with small reprojection errors
  double min_parallax_deg = 1.5;  // of the agreeing matches' rays, in the median, those of distant points included
  // If a pure rotation explains this share of what the best motion explains, it is assumed.
  double max_turn_share = 0.6;
  // If another motion explains this share of what the best one explains, the result is ambiguous.
  double max_rival_share = 0.88;
  // By the covariance of the refined motion, in its least certain direction.
  double max_rotation_sigma_deg = 0.8;
  double max_direction_sigma_deg = 3;
  int max_iterations = 200;  // RANSAC
  uint64_t seed = 1;
};

struct TwoViewResult {
  TwoViewOutcome outcome = TwoViewOutcome::kTooFewMatches;
  bool from_homography = false;        // the homography explained the matches about as well: the scene is nearly planar
  SE3<Camera, Camera> T_first_second;  // second camera to first camera; |translation| = 1
  std::vector<std::optional<Eigen::Vector3d>> points_first;  // per match: in the first camera's frame, if usable
  int points = 0;
  double parallax_rad = 0;  // median over the agreeing matches
};

// Structure and motion from two views of one calibrated camera, without any prior. RANSAC fits a homography and an
// essential matrix to the same samples (as Mur-Artal et al., 2015, section IV, but with the five points of Nister 2004
// instead of eight: planes are no special case to them, and outliers hurt less). The motions of both models (of the
// homography: Malis and Vargas 2007) are refined, and the one that most matches agree with, in front of both cameras,
// is returned if nothing speaks against it: neither a mere turn, nor a rival motion, nor its own uncertainty.
TwoViewResult SolveTwoView(const CameraModel& camera, std::span<const TwoViewMatch> matches,
                           const TwoViewOptions& options);

// A few words for people: "too little parallax: the camera stood still or only turned".
const char* Describe(TwoViewOutcome outcome);

}  // namespace romap::slam
