#include "client/doctor/stamps_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/statistics.h"

namespace romap::doctor {
namespace {

constexpr double kMaxRateRatio = 1.3;  // of the measured and the nominal rate
constexpr double kGapPeriods = 3.5;    // a gap of this many median periods: at least three frames are missing
constexpr size_t kMinFrames = 5;

}  // namespace

std::vector<Diagnostic> CheckStamps(std::span<const int64_t> stamps_ns, double nominal_fps) {
  std::vector<Diagnostic> found;
  if (stamps_ns.size() < kMinFrames) return found;
  std::vector<double> periods_s;
  for (size_t i = 1; i < stamps_ns.size(); ++i) {
    periods_s.push_back(1e-9 * static_cast<double>(stamps_ns[i] - stamps_ns[i - 1]));
  }
  const double median_s = Median(periods_s);
  const double rate = 1 / median_s;
  if (std::max(rate / nominal_fps, nominal_fps / rate) > kMaxRateRatio) {
    found.push_back(
        {.code = "frame_rate",
         .severity = Severity::kWarning,
         .text = fmt::format("the timestamps say {:.1f} frames per second, camera.yaml says {:.1f}", rate, nominal_fps),
         .advice = "correct fps in camera.yaml; masks and poses are matched within half a frame period"});
  }
  uint64_t gaps = 0, first_frame = 0;
  double longest_s = 0;
  for (size_t i = 0; i < periods_s.size(); ++i) {
    if (periods_s[i] < kGapPeriods * median_s) continue;
    if (gaps++ == 0) first_frame = i + 2;  // frame ids count from 1
    longest_s = std::max(longest_s, periods_s[i]);
  }
  if (gaps > 0) {
    found.push_back({.code = "frames_missing",
                     .severity = Severity::kWarning,
                     .first_frame_id = first_frame,
                     .count = gaps,
                     .text = fmt::format("{} gaps of more than three frames, the longest of {:.2f} s: a camera that is "
                                         "tracked from images may be lost there",
                                         gaps, longest_s),
                     .advice = "record to a faster disk or at a lower rate"});
  }
  return found;
}

}  // namespace romap::doctor
