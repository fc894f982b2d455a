#include "server/slam/pose_noise.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/statistics.h"
#include "server/slam/geometry/epipolar.h"
#include "server/slam/geometry/motion_search.h"

namespace romap::slam {
namespace {

constexpr size_t kMaxNoisePairs = 24;
constexpr size_t kMinNoisePairs = 8;
constexpr int kNoiseIterations = 80;
// Of the image width: 1.2 px of 640. Below, the search for a better motion is not worth its time.
constexpr double kInexact = 1.2 / 640;
constexpr double kMinNoiseRatio = 2.5;  // of the distances for the given and for the best motion

double MedianDistance_px(const CameraModel& camera, const Motion& motion, const std::vector<RayMatch>& rays) {
  const Eigen::Matrix3d essential = motion.Essential();
  std::vector<double> distances_px;
  for (const RayMatch& match : rays) {
    distances_px.push_back(match.sigma_px * std::sqrt(SampsonChi2(camera, essential, match)));
  }
  return Median(std::move(distances_px));
}

}  // namespace

void PoseNoise::AddPair(const CameraModel& camera, const PoseCheck::AgreeingPair& pair) {
  const double distance_mu = pair.T_second_first.translation().norm();
  if (!(distance_mu > 0) || pair.matches.empty()) return;
  width_px_ = camera.width_px;
  const std::vector<RayMatch> rays = ToRays(camera, pair.matches);
  const Motion given{pair.T_second_first.RotationMatrix(), pair.T_second_first.translation() / distance_mu};
  Residuals residuals{.given = MedianDistance_px(camera, given, rays) / camera.width_px};
  residuals.best = residuals.given;
  if (residuals.given > kInexact) {
    const auto best = FindMotion(camera, rays, kNoiseIterations, config_.Seed(++pairs_seen_));
    if (best) residuals.best = std::min(residuals.given, MedianDistance_px(camera, *best, rays) / camera.width_px);
  }
  pairs_.push_back(residuals);
  if (pairs_.size() > kMaxNoisePairs) pairs_.pop_front();
}

std::optional<Diagnostic> PoseNoise::Check() const {
  if (pairs_.size() < kMinNoisePairs) return std::nullopt;
  std::vector<double> given, best;
  for (const Residuals& pair : pairs_) {
    given.push_back(pair.given);
    best.push_back(pair.best);
  }
  const double given_median = Median(std::move(given));
  const double best_median = Median(std::move(best));
  if (given_median < kInexact || given_median < kMinNoiseRatio * best_median) return std::nullopt;
  return Diagnostic{
      .code = "poses_inexact",
      .severity = Severity::kWarning,
      .text = fmt::format("the given poses are less exact than the images: with them, half of the feature matches are "
                          "more than {:.1f} px off their epipolar lines, with the best motion {:.1f} px; objects are "
                          "less accurate",
                          given_median * width_px_, best_median * width_px_),
      .advice = "check the calibration and the clock of the poses; with --poses prior, tracking corrects them"};
}

}  // namespace romap::slam
