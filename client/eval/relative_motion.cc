#include "client/eval/relative_motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/angles.h"
#include "common/statistics.h"

namespace romap::eval {
namespace {

constexpr double kMaxWindowStretch = 1.5;
constexpr double kMinLengthShare = 0.25;  // motions shorter than this share of the median length have no stable ratio
constexpr size_t kMinMotions = 3;

std::vector<double> PathLengths(std::span<const PosePair> pairs) {
  std::vector<double> path_m(pairs.size());
  for (size_t k = 1; k < pairs.size(); ++k) {
    path_m[k] = path_m[k - 1] + (pairs[k].truth.translation() - pairs[k - 1].truth.translation()).norm();
  }
  return path_m;
}

RelativeMotion Between(const PosePair& from, const PosePair& to, double path_m) {
  const SE3<Camera, Camera> estimated = from.estimated.Inverse() * to.estimated;
  const SE3<Camera, Camera> truth = from.truth.Inverse() * to.truth;
  return {.start_ns = from.timestamp_ns,
          .end_ns = to.timestamp_ns,
          .path_m = path_m,
          .estimated = estimated.translation(),
          .truth = truth.translation(),
          .rotation_error_deg = truth.rotation().angularDistance(estimated.rotation()) * kDegPerRad};
}

double Seconds(int64_t timestamp_ns) { return static_cast<double>(timestamp_ns) * 1e-9; }

}  // namespace

std::vector<RelativeMotion> FrameMotions(std::span<const PosePair> pairs) {
  const std::vector<double> path_m = PathLengths(pairs);
  std::vector<RelativeMotion> motions;
  for (size_t k = 1; k < pairs.size(); ++k) motions.push_back(Between(pairs[k - 1], pairs[k], path_m[k - 1]));
  return motions;
}

std::vector<RelativeMotion> WindowMotions(std::span<const PosePair> pairs, double window_s) {
  const std::vector<double> path_m = PathLengths(pairs);
  std::vector<RelativeMotion> motions;
  size_t end = 0;
  for (size_t start = 0; start < pairs.size(); ++start) {
    const auto elapsed_s = [&] { return Seconds(pairs[end].timestamp_ns - pairs[start].timestamp_ns); };
    while (end < pairs.size() && elapsed_s() < window_s) ++end;
    if (end == pairs.size()) break;
    if (elapsed_s() <= kMaxWindowStretch * window_s)
      motions.push_back(Between(pairs[start], pairs[end], path_m[start]));
  }
  return motions;
}

std::optional<double> DirectionCorrelation(std::span<const RelativeMotion> motions) {
  double weighted = 0, total_m = 0;
  for (const RelativeMotion& motion : motions) {
    total_m += motion.truth.norm();
    const double length = motion.estimated.norm();
    if (length > 0) weighted += motion.truth.dot(motion.estimated) / length;
  }
  return total_m > 0 ? std::optional(weighted / total_m) : std::nullopt;
}

std::optional<double> SignedScale(std::span<const RelativeMotion> motions) {
  std::vector<double> lengths_m;
  for (const RelativeMotion& motion : motions) lengths_m.push_back(motion.truth.norm());
  if (lengths_m.empty()) return std::nullopt;
  const double shortest_m = kMinLengthShare * Median(lengths_m);
  // Estimated to true length, because an estimated length may be 0.
  std::vector<double> ratios;
  for (size_t k = 0; k < motions.size(); ++k) {
    if (lengths_m[k] <= 0 || lengths_m[k] < shortest_m) continue;
    ratios.push_back(std::copysign(motions[k].estimated.norm(), motions[k].truth.dot(motions[k].estimated)) /
                     lengths_m[k]);
  }
  if (ratios.size() < kMinMotions) return std::nullopt;
  const double ratio = Median(std::move(ratios));
  return ratio == 0 ? std::nullopt : std::optional(1 / ratio);
}

std::vector<double> LocalScales(std::span<const RelativeMotion> motions, int sections) {
  std::vector<double> scales;
  if (motions.empty()) return scales;
  const double path_m = motions.back().path_m;
  size_t begin = 0;
  for (int section = 1; section <= sections; ++section) {
    size_t end = begin;
    while (end < motions.size() && (section == sections || motions[end].path_m < path_m * section / sections)) ++end;
    const std::optional<double> scale = SignedScale(motions.subspan(begin, end - begin));
    if (scale) scales.push_back(*scale);
    begin = end;
  }
  return scales;
}

Jumps LargestJumps(std::span<const RelativeMotion> frame_motions, double scale) {
  Jumps jumps;
  for (const RelativeMotion& motion : frame_motions) {
    const double error_m = (scale * motion.estimated - motion.truth).norm();
    if (error_m > jumps.position_m) {
      jumps.position_m = error_m;
      jumps.position_s = Seconds(motion.end_ns);
    }
    if (motion.rotation_error_deg > jumps.rotation_deg) {
      jumps.rotation_deg = motion.rotation_error_deg;
      jumps.rotation_s = Seconds(motion.end_ns);
    }
  }
  return jumps;
}

std::string MotionFigures::WindowText() const {
  return window_s > 0 ? fmt::format("over {:g} s", window_s) : "between frames";
}

MotionFigures MeasureMotion(std::span<const PosePair> pairs, double extent_m, double fit_scale) {
  const std::vector<RelativeMotion> frames = FrameMotions(pairs);
  std::vector<RelativeMotion> windows = WindowMotions(pairs, kWindow_s);
  const bool has_windows = windows.size() >= kMinMotions;
  if (!has_windows) windows = frames;
  std::vector<double> angles_deg;
  for (const RelativeMotion& motion : windows) angles_deg.push_back(motion.rotation_error_deg);

  MotionFigures figures{.window_s = has_windows ? kWindow_s : 0,
                        .rotation_median_deg = Quantile(angles_deg, 0.5),
                        .rotation_95_deg = Quantile(angles_deg, 0.95),
                        .jumps = LargestJumps(frames, fit_scale)};
  if (extent_m < kMinExtent_m) {
    figures.scale_note =
        fmt::format("the true positions vary by only {:.3g} m rms; at least {} m required", extent_m, kMinExtent_m);
    return figures;
  }
  figures.frame_correlation = DirectionCorrelation(frames);
  figures.window_correlation = DirectionCorrelation(windows);
  const double correlation = figures.window_correlation.value_or(0);
  if (std::abs(correlation) >= kMinScaleCorrelation) {
    figures.scale = SignedScale(windows);
    if (!figures.scale) figures.scale_note = "too few motions of the estimated camera";
  } else {
    figures.scale_note =
        fmt::format("the translation error exceeds the true translation (correlation {:.2f})", correlation);
  }
  if (figures.scale) figures.local_scales = LocalScales(windows, kPathSections);
  return figures;
}

}  // namespace romap::eval
