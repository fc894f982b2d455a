#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/camera_model.h"
#include "common/geometry.h"

namespace romap {

struct TwoViewMatch {
  Eigen::Vector2d first_px = Eigen::Vector2d::Zero();  // undistorted
  Eigen::Vector2d second_px = Eigen::Vector2d::Zero();
  double sigma_px = 1;  // standard deviation per axis of the worse of the two
};

enum class TwoViewOutcome {
  kOk,
  kTooFewMatches,      // fewer than min_matches, or fewer inliers than min_points under the best model
  kTooLittleParallax,  // the best motion is a turn, or its rays are too close to parallel
  kAmbiguous,          // two motions explain the matches about equally well
};

struct TwoViewOptions {
  int min_matches = 80;
  int min_points = 50;            // triangulated, before both cameras, with small reprojection errors
  double min_parallax_deg = 1.0;  // of the points' rays, in the median
  int max_iterations = 200;       // RANSAC
  uint64_t seed = 1;
};

struct TwoViewResult {
  TwoViewOutcome outcome = TwoViewOutcome::kTooFewMatches;
  bool from_homography = false;                              // which of the two models was chosen
  SE3<Camera, Camera> T_first_second;                        // second camera to first camera; |translation| = 1
  std::vector<std::optional<Eigen::Vector3d>> points_first;  // per match: in the first camera's frame, if usable
  int points = 0;
  double parallax_rad = 0;  // median over the points
};

// Structure and motion from two views of one camera, without any prior (Hartley and Zisserman; Mur-Artal et al., 2015,
// section IV): a homography and a fundamental matrix are fitted in parallel by RANSAC on the same minimal samples,
// scored by symmetric transfer errors in the same way, and the homography is taken when its share of the score says
// that the scene is (nearly) planar. Its motions (Malis and Vargas 2007; cv::decomposeHomographyMat) or the essential
// matrix's four are told apart by the points that they put before both cameras.
TwoViewResult SolveTwoView(const CameraModel& camera, std::span<const TwoViewMatch> matches,
                           const TwoViewOptions& options);

// One line for people: "too little parallax: 0.4 deg, 1.0 needed".
const char* Describe(TwoViewOutcome outcome);

}  // namespace romap
