#include "server/slam/depth_check.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>
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

// With equal spreads there is no difference to see, e.g. in a narrow view or with noisy depths.
constexpr size_t kMinRayPairs = 6;
constexpr double kMaxRaySpreadRatio = 0.85;  // of the spreads along the ray and along the axis, median of the pairs
constexpr double kAlongRayShare = 0.8;       // of the pairs have less spread along the ray

// NaN: no depth at the pixel, or the point is not usable.
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

double MedianDeviation(const std::vector<double>& values) {
  const double median = Median(values);
  std::vector<double> deviations;
  for (const double value : values) deviations.push_back(std::abs(value - median));
  return Median(std::move(deviations));
}

}  // namespace

DepthCheck::Pair DepthCheck::Summarize(const std::vector<double>& log_ratios, const std::vector<double>& log_lengths) {
  std::vector<double> along_ray;
  for (size_t i = 0; i < log_ratios.size(); ++i) along_ray.push_back(log_ratios[i] + log_lengths[i]);
  return {.log_ratio = Median(log_ratios),
          .axis_spread = MedianDeviation(log_ratios),
          .ray_spread = MedianDeviation(along_ray)};
}

void DepthCheck::AddPair(const CameraModel& camera, const PoseCheck::AgreeingPair& pair, const cv::Mat& depth_mu) {
  const double baseline_mu = pair.T_second_first.translation().norm();
  const std::optional<Motion> motion = pair.GivenMotion();
  if (depth_mu.empty() || !motion) return;
  std::vector<double> log_ratios, log_lengths;
  for (const TwoViewMatch& match : pair.matches) {
    const double log_ratio = LogDepthRatio(camera, *motion, baseline_mu, match, depth_mu);
    if (!std::isfinite(log_ratio)) continue;
    log_ratios.push_back(log_ratio);
    log_lengths.push_back(std::log(camera.Unproject(match.second_px.x(), match.second_px.y()).norm()));
  }
  if (log_ratios.size() < kMinDepthPoints) return;
  pairs_.push_back(Summarize(log_ratios, log_lengths));
  if (pairs_.size() > 1) first_frame_ids_.push_back(pair.first_frame_id);
  if (pairs_.size() > kDepthWindowPairs) {
    pairs_.pop_front();
    first_frame_ids_.pop_front();
  }
  spdlog::debug(
      "slam: depth by the given poses over that of the image: {:.3f} at {} points, spread {:.4f}, along rays {:.4f}",
      std::exp(pairs_.back().log_ratio), log_ratios.size(), pairs_.back().axis_spread, pairs_.back().ray_spread);
  factor_ = FindFactor();
  is_along_ray_ = FitsBetterAlongRay();
}

std::optional<double> DepthCheck::FindFactor() const {
  if (pairs_.size() < kMinDepthPairs) return std::nullopt;
  std::vector<double> log_ratios;
  for (const Pair& pair : pairs_) log_ratios.push_back(pair.log_ratio);
  const double median = Median(log_ratios);
  const double sigma = kMadToSigma * MedianDeviation(log_ratios);
  const bool is_wrong = std::abs(median) > std::log(kMaxDepthFactor) && std::abs(median) > kDepthSigmas * sigma;
  return is_wrong ? std::optional(std::exp(median)) : std::nullopt;
}

bool DepthCheck::FitsBetterAlongRay() const {
  if (pairs_.size() < kMinRayPairs) return false;
  size_t fitting = 0;
  std::vector<double> ratios;
  for (const Pair& pair : pairs_) {
    fitting += pair.ray_spread < pair.axis_spread ? 1 : 0;
    ratios.push_back(pair.ray_spread / std::max(pair.axis_spread, 1e-9));
  }
  return static_cast<double>(fitting) >= kAlongRayShare * static_cast<double>(pairs_.size()) &&
         Median(std::move(ratios)) < kMaxRaySpreadRatio;
}

std::optional<Diagnostic> DepthCheck::Check() const {
  if (factor_) {
    const bool is_too_small = *factor_ > 1;
    return Diagnostic{
        .code = "depth_contradicts_images",
        .severity = Severity::kError,
        .text = fmt::format("the depth images do not fit the images and the given poses: depths are {:.2f} times too "
                            "{} at the features "
                            "of {} pairs of frames; depth is not used while this lasts",
                            is_too_small ? *factor_ : 1 / *factor_, is_too_small ? "small" : "large", pairs_.size()),
        .advice = fmt::format(
            "multiply the depth scale (depth_scale of camera.yaml) by {:.3g}, or check that the poses are in the same "
            "unit",
            *factor_)};
  }
  if (!is_along_ray_) return std::nullopt;
  return Diagnostic{
      .code = "depth_contradicts_images",
      .severity = Severity::kError,
      .text = fmt::format(
          "the depth images hold distances along the viewing rays, not depths along the optical axis: so they fit the "
          "images and the given poses better at the features of {} pairs of frames; depth is not used while this lasts",
          pairs_.size()),
      .advice = "divide the depth at pixel (u, v) by the length of ((u - cx) / fx, (v - cy) / fy, 1)"};
}

std::shared_ptr<const Frame> WithoutDepth(const Frame& frame) {
  auto without = std::make_shared<Frame>(frame);
  without->depth_mu.release();
  return without;
}

}  // namespace romap::slam
