#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/camera_model.h"
#include "common/geometry.h"
#include "server/slam/optimize/radial_correction.h"

namespace romap::slam {

// What is believed of a pose from elsewhere (a client's tracker): a soft constraint.
struct PosePrior {
  SE3<World, Camera> T_world_camera;
  double rotation_sigma_rad = 0.01;
  double translation_sigma_mu = 0.01;
};

struct BundleCamera {
  SE3<World, Camera> T_world_camera;
  bool fixed = false;
  std::optional<PosePrior> prior;
};

struct BundlePoint {
  Eigen::Vector3d position_world = Eigen::Vector3d::Zero();
  bool fixed = false;
};

struct BundleObservation {
  int camera = 0;  // index
  int point = 0;   // index
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();
  double sigma_px = 1;
  double depth_mu = 0;  // measured z depth, 0 = unknown
  double depth_sigma_mu = 0;
  bool outlier = false;  // in: left out of the problem. out: its error is beyond the 95 % bound
};

// A lens to be found along with the rest.
struct BundleLens {
  RadialCorrection correction = {};  // in: the start. out: what fits
  double sigma = 0.03;               // standard deviation of its k1 around 0 before anything is seen
};

struct BundleProblem {
  CameraModel camera;  // of all cameras; pinhole
  std::optional<BundleLens>
      lens;  // of all cameras; then pixels are as the picture shows them, else as the pinhole does
  std::vector<BundleCamera> cameras;
  std::vector<BundlePoint> points;
  std::vector<BundleObservation> observations;
};

struct BundleOptions {
  int max_iterations = 10;
  // A relative fall of the cost per iteration below which the map no longer changes visibly. Where all of a map bends
  // together, or with the lens, many small falls add up.
  double function_tolerance = 1e-4;
  bool reject_outliers = true;  // after half of the iterations, beyond the bound; they may come back at the end
  bool dense = false;           // few cameras: DENSE_SCHUR instead of SPARSE_SCHUR
  int threads = 1;
  const std::atomic<bool>* abort = nullptr;  // looked at in every iteration; what was reached is kept
};

struct BundleSummary {
  int iterations = 0;
  // Root mean square reprojection error over the observations used (at last only the inliers), weighted by 1 / sigma^2.
  double initial_rms_px = 0;
  double final_rms_px = 0;
  int outliers = 0;
  bool aborted = false;
  bool usable = false;  // false: nothing was changed (numerical failure, or nothing to do)
};

// Bundle adjustment (Triggs et al. 2000) with Ceres: reprojection errors (and inverse-depth errors where depth was
// measured), Huber loss at the 95 % bound, analytic Jacobians, right-multiplied SE3 increments, points eliminated by
// the Schur complement. With `lens` the cameras' common rest of a lens is found too (self-calibration: Triggs et al.,
// section 6.3); orbits and hands turn and tilt enough to tell it from the scene. Deterministic with one thread. The
// caller fixes the gauge through `fixed` cameras (two for a monocular map, or the far end of the window).
//
// Left out, and left as they are: points that no free camera sees, points that one camera sees without depth, and
// observations that make no sense (index out of range, numbers not finite, sigma not positive, point behind the
// camera). At the end all observations are judged, also those left out, unless the result is not usable.
BundleSummary AdjustBundle(BundleProblem& problem, const BundleOptions& options);

}  // namespace romap::slam
