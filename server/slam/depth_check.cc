#include "server/slam/depth_check.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/angles.h"
#include "common/statistics.h"
#include "server/slam/geometry/epipolar.h"
#include "server/slam/geometry/projection_ray.h"

namespace romap::slam {
namespace {

constexpr double kMaxRayDistance_px = 4;  // of a match from its projections
constexpr double kMinDepthParallax_rad = 2 * kRadPerDeg;
constexpr size_t kMinDepthPoints = 15;  // of a pair
constexpr size_t kMinDepthPairs = 3;
constexpr size_t kDepthWindowPairs = 12;
constexpr double kMaxDepthFactor = 1.15;  // factor
// The pairs have noise in common, e.g. that of the clock, so that their mean is hardly more certain than one of them.
constexpr double kDepthSigmas = 3;
constexpr double kMadToSigma = 1.4826;

// NaN: no depth at the pixel.
double LogDepthRatio(const CameraModel& camera, const Motion& motion, double baseline_mu, const TwoViewMatch& match,
                     const cv::Mat& depth_mu) {
  const auto u = static_cast<int>(std::lround(match.second_px.x()));
  const auto v = static_cast<int>(std::lround(match.second_px.y()));
  if (u < 0 || v < 0 || u >= depth_mu.cols || v >= depth_mu.rows) return std::nan("");
  const double measured_mu = depth_mu.at<float>(v, u);
  const RayMatch rays{camera.Unproject(match.first_px.x(), match.first_px.y()),
                      camera.Unproject(match.second_px.x(), match.second_px.y()), match.sigma_px};
  const double distance_px =
      DistanceToProjectionRay_px(camera, motion.rotation, motion.direction, rays.first, match.second_px);
  const RayIntersection point = Intersect(camera, motion, rays);
  const bool is_usable = distance_px < kMaxRayDistance_px && point.parallax_rad > kMinDepthParallax_rad &&
                         point.is_significant && point.IsInFrontOfBoth() && measured_mu > 0;
  return is_usable ? std::log(baseline_mu * point.second_depth / measured_mu) : std::nan("");
}

}  // namespace

void DepthCheck::AddPair(const CameraModel& camera, const PoseCheck::AgreeingPair& pair, const cv::Mat& depth_mu) {
  const double baseline_mu = pair.T_second_first.translation().norm();
  if (depth_mu.empty() || !(baseline_mu > 0)) return;
  const Motion motion{pair.T_second_first.RotationMatrix(), pair.T_second_first.translation() / baseline_mu};
  std::vector<double> log_ratios;
  for (const TwoViewMatch& match : pair.matches) {
    const double log_ratio = LogDepthRatio(camera, motion, baseline_mu, match, depth_mu);
    if (std::isfinite(log_ratio)) log_ratios.push_back(log_ratio);
  }
  if (log_ratios.size() < kMinDepthPoints) return;
  log_ratios_.push_back(Median(log_ratios));
  if (log_ratios_.size() > 1) first_frame_ids_.push_back(pair.first_frame_id);
  if (log_ratios_.size() > kDepthWindowPairs) {
    log_ratios_.pop_front();
    first_frame_ids_.pop_front();
  }
  spdlog::debug("slam: depth by the given poses over that of the image: {:.3f} at {} points",
                std::exp(log_ratios_.back()), log_ratios.size());
  Decide();
}

void DepthCheck::Decide() {
  factor_ = std::nullopt;
  if (log_ratios_.size() < kMinDepthPairs) return;
  const double median = Median(std::vector<double>(log_ratios_.begin(), log_ratios_.end()));
  std::vector<double> deviations;
  for (const double log_ratio : log_ratios_) deviations.push_back(std::abs(log_ratio - median));
  const double sigma = kMadToSigma * Median(std::move(deviations));
  if (std::abs(median) > std::log(kMaxDepthFactor) && std::abs(median) > kDepthSigmas * sigma)
    factor_ = std::exp(median);
}

std::optional<Diagnostic> DepthCheck::Check() const {
  if (!factor_) return std::nullopt;
  const bool is_too_small = *factor_ > 1;
  return Diagnostic{.code = "depth_contradicts_images",
                    .severity = Severity::kError,
                    .text = fmt::format(
                        "the depth images do not fit the images and the given poses: depths are {:.2f} times too {} at "
                        "the features of {} pairs of frames; depth is not used while this lasts",
                        is_too_small ? *factor_ : 1 / *factor_, is_too_small ? "small" : "large", log_ratios_.size()),
                    .advice = fmt::format(
                        "multiply the depth scale (depth_scale of camera.yaml) by {:.3g}, or check that the poses are "
                        "in the same unit",
                        *factor_)};
}

std::shared_ptr<const Frame> WithoutDepth(const Frame& frame) {
  auto without = std::make_shared<Frame>(frame);
  without->depth_mu.release();
  return without;
}

}  // namespace romap::slam
