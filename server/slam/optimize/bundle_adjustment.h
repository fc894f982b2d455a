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

// A pose estimate from another source (the client's tracker), used as a soft constraint.
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
  bool outlier = false;  // in: ignored. out: the error exceeds the 95 % bound
};

// Lens distortion to be estimated.
struct BundleLens {
  RadialCorrection correction = {};  // in: initial value. out: estimate
  double sigma = 0.03;               // standard deviation of the prior of k1, whose mean is 0
};

struct BundleProblem {
  CameraModel camera;  // of all cameras; pinhole
  // Of all cameras. If set, observations are pixels of the uncorrected image, else of the pinhole image.
  std::optional<BundleLens> lens;
  std::vector<BundleCamera> cameras;
  std::vector<BundlePoint> points;
  std::vector<BundleObservation> observations;
};

struct BundleOptions {
  int max_iterations = 10;
  // Stops when an iteration reduces the cost by less than this share. The default is sufficient for local changes.
  // Correcting a bend of the whole map or estimating the lens takes many small steps and needs a smaller value.
  double function_tolerance = 1e-4;
  bool reject_outliers = true;  // those beyond the bound, after half of the iterations; all are reclassified at the end
  bool dense = false;           // few cameras: DENSE_SCHUR instead of SPARSE_SCHUR
  int threads = 1;
  const std::atomic<bool>* abort = nullptr;  // checked in every iteration; the state reached is kept
};

struct BundleSummary {
  int iterations = 0;
  // Root mean square reprojection error, weighted by 1 / sigma^2, over the observations used (the
  // inliers for final_rms_px).
  double initial_rms_px = 0;
  double final_rms_px = 0;
  int outliers = 0;
  bool aborted = false;
  bool usable = false;  // false: nothing was changed (numerical failure, or nothing to do)
};

// How well a problem's cameras and points fit its observations.
struct BundleFit {
  int observations = 0;  // valid ones
  int outliers = 0;      // of those, beyond the 95 % bound
  double rms_px = 0;     // of the others, weighted by 1 / sigma^2

  double OutlierShare() const { return observations > 0 ? static_cast<double>(outliers) / observations : 0; }
};

BundleFit MeasureFit(const BundleProblem& problem);

// Sets BundleObservation::outlier of all observations.
void ClassifyOutliers(BundleProblem& problem);

// The observations' standard deviation as a factor of the one they claim: from the median of their errors, so that
// outliers hardly change it. 1 without valid observations.
double MeasureNoise(const BundleProblem& problem);

// Bundle adjustment (Triggs et al. 2000) with Ceres: reprojection errors (and inverse-depth errors where depth was
// measured), Huber loss at the 95 % bound, analytic Jacobians, right-multiplied SE3 increments, points eliminated by
// the Schur complement. With `lens`, the remaining distortion of the cameras' common lens is estimated too
// (self-calibration: Triggs et al., section 6.3). Hand-held and orbiting cameras rotate enough to separate it from the
// shape of the scene. Deterministic with one thread. The caller fixes the gauge through `fixed` cameras (two for a
// monocular map, or the far end of the window).
//
// Ignored and left unchanged: points that no free camera observes, points that a single camera observes without depth,
// and invalid observations (index out of range, numbers not finite, sigma not positive, point behind the camera). At
// the end, `outlier` is set for all observations, including ignored ones, unless the result is not usable.
BundleSummary AdjustBundle(BundleProblem& problem, const BundleOptions& options);

}  // namespace romap::slam
