#include "server/slam/pose_noise.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>
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

}  // namespace

void PoseNoise::AddPair(const CameraModel& camera, const PoseCheck::AgreeingPair& pair) {
  const std::optional<Motion> given = pair.GivenMotion();
  if (!given) return;
  width_px_ = camera.width_px;
  const std::vector<RayMatch> rays = ToRays(camera, pair.matches);
  Residuals residuals{.given = MedianEpipolarDistance_px(camera, *given, rays) / camera.width_px};
  residuals.best = residuals.given;
  if (residuals.given > kInexact) {
    const auto best = FindMotion(camera, rays, kNoiseIterations, config_.Seed(++pairs_seen_));
    if (best)
      residuals.best = std::min(residuals.given, MedianEpipolarDistance_px(camera, *best, rays) / camera.width_px);
  }
  if (residuals.given > kInexact) {
    for (const PoseHypothesis& flip : FlipHypotheses()) {
      const CameraModel flipped = ReadCamera(flip, camera);
      const std::vector<RayMatch> flipped_rays = ToRays(flipped, pair.matches);
      residuals.flipped.push_back(MedianEpipolarDistance_px(flipped, *given, flipped_rays) / camera.width_px);
    }
  }
  pairs_.push_back(residuals);
  if (pairs_.size() > kMaxNoisePairs) pairs_.pop_front();
}

const std::vector<PoseHypothesis>& PoseNoise::FlipHypotheses() {
  static const std::vector<PoseHypothesis> flips = [] {
    std::vector<PoseHypothesis> all = AllPoseHypotheses();
    std::erase_if(all, [](const PoseHypothesis& hypothesis) { return !hypothesis.IsFlip(); });
    return all;
  }();
  return flips;
}

double PoseNoise::MedianOf(double Residuals::*distance) const {
  std::vector<double> distances;
  for (const Residuals& pair : pairs_) distances.push_back(pair.*distance);
  return Median(std::move(distances));
}

bool PoseNoise::IsInexact() const {
  if (pairs_.size() < kMinNoisePairs) return false;
  const double given = MedianOf(&Residuals::given);
  return given > kInexact && given > kMinNoiseRatio * MedianOf(&Residuals::best);
}

std::optional<PoseHypothesis> PoseNoise::FindFlip() const {
  if (!IsInexact()) return std::nullopt;
  const double given = MedianOf(&Residuals::given);
  for (size_t i = 0; i < FlipHypotheses().size(); ++i) {
    std::vector<double> distances;
    for (const Residuals& pair : pairs_) distances.push_back(pair.flipped.empty() ? pair.given : pair.flipped[i]);
    const double flipped = Median(std::move(distances));
    if (flipped < kInexact && given > kMinNoiseRatio * flipped) return FlipHypotheses()[i];
  }
  return std::nullopt;
}

std::optional<Diagnostic> PoseNoise::Check() const {
  if (!IsInexact()) return std::nullopt;
  const double given_px = MedianOf(&Residuals::given) * width_px_;
  if (const auto flip = FindFlip()) {
    return Diagnostic{.code = "poses_contradict_images",
                      .severity = Severity::kError,
                      .first_frame_id = 1,
                      .text = fmt::format(
                          "the given poses do not fit the images: half of the feature matches are more than {:.1f} px "
                          "off their epipolar lines, but hardly any when the images are taken {}; frames are not used "
                          "while this lasts",
                          given_px, Describe(*flip)),
                      .advice = kFlipAdvice};
  }
  return Diagnostic{
      .code = "poses_inexact",
      .text = fmt::format("the given poses are less exact than the images: with them, half of the feature matches are "
                          "more than {:.1f} px off their epipolar lines, with the best motion {:.1f} px; objects are "
                          "less accurate",
                          given_px, MedianOf(&Residuals::best) * width_px_),
      .advice = "check the calibration and the clock of the poses; with --poses prior, tracking corrects them"};
}

}  // namespace romap::slam
