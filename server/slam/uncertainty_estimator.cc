#include "server/slam/uncertainty_estimator.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include "server/slam/geometry/pose_covariance.h"
#include "server/slam/map_adjustment.h"
#include "server/slam/optimize/bundle_covariance.h"

namespace romap::slam {
namespace {

constexpr double kGrowth = 1.2;  // of the number of keyframes
// The errors of a point's observations are nearly the same in neighboring keyframes, because its image is: they do not
// average out like the independent errors that BundleCovariances() assumes. Ratio of actual and computed sigmas, from
// rendered sequences of different kinds (tests/bench/uncertainty_quality.sh), where it is between 3 and 6.
constexpr double kSigmaFactor = 4.5;
// Depth images have whole pixels, and features prefer edges: the depth at a feature is that of a point about this far
// away, often in the same direction. This makes an error of the scale that does not average out.
constexpr double kDepthShift_px = 0.4;

// Of the scale of a map whose scale is from depth images.
double DepthScaleSigma(const BundleProblem& problem) {
  const bool has_depth = std::any_of(problem.observations.begin(), problem.observations.end(),
                                     [](const BundleObservation& observation) { return observation.depth_mu > 0; });
  return has_depth ? kDepthShift_px / problem.camera.fx_px : 0;
}

Eigen::Vector3d MeanCameraPosition(const BundleProblem& problem) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const BundleCamera& camera : problem.cameras) sum += camera.T_world_camera.translation();
  return sum / static_cast<double>(problem.cameras.size());
}

// Sets the uncertainties of the map's keyframes. Returns whether the observations determine them.
bool SetUncertainties(const MapProblem& problem, SlamMap& map) {
  constexpr double kVarianceFactor = kSigmaFactor * kSigmaFactor;
  const std::vector<CameraCovariance> covariances = BundleCovariances(problem.bundle);
  const double scale_sigma = DepthScaleSigma(problem.bundle);
  const Eigen::Vector3d mean = MeanCameraPosition(problem.bundle);
  for (size_t i = 0; i < covariances.size(); ++i) {
    MapKeyframe& keyframe = *map.FindKeyframe(problem.keyframes[i]);
    const Eigen::Vector3d shift_mu = scale_sigma * (keyframe.center_world() - mean);
    keyframe.uncertainty = {
        EquivalentSigma(kVarianceFactor * covariances[i].position_mu2 + shift_mu * shift_mu.transpose()),
        EquivalentSigma(kVarianceFactor * covariances[i].rotation_rad2)};
  }
  return !covariances.empty();
}

}  // namespace

void UncertaintyEstimator::Update(bool find_lens, SlamMap& map) {
  const size_t keyframes = map.keyframes().size();
  if (keyframes < 2) return;
  if (!is_requested_ && static_cast<double>(keyframes) < kGrowth * static_cast<double>(keyframes_)) return;
  const auto start = std::chrono::steady_clock::now();
  is_requested_ = false;
  keyframes_ = keyframes;
  has_changed_ |= SetUncertainties(GlobalProblem(map, config_, find_lens), map);
  spdlog::debug("slam: uncertainties of {} keyframes in {:.0f} ms", keyframes,
                1e3 * std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
}

bool UncertaintyEstimator::TakeChange() { return std::exchange(has_changed_, false); }

}  // namespace romap::slam
