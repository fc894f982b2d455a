#include "client/eval/frame_coverage.h"

#include <algorithm>
#include <vector>

#include "client/files/associate.h"
#include "common/statistics.h"

namespace romap::eval {
namespace {

// Median difference of consecutive timestamps; 0 if there are fewer than two.
int64_t MedianPeriod_ns(std::span<const int64_t> timestamps_ns) {
  std::vector<int64_t> periods_ns;
  for (size_t k = 1; k < timestamps_ns.size(); ++k) periods_ns.push_back(timestamps_ns[k] - timestamps_ns[k - 1]);
  return periods_ns.empty() ? 0 : Median(std::move(periods_ns));
}

}  // namespace

FrameCoverage CoverageOf(std::span<const int64_t> frames_ns, std::span<const int64_t> poses_ns) {
  const auto pairs = files::AssociateTimestamps(frames_ns, poses_ns, MedianPeriod_ns(frames_ns) / 2);
  FrameCoverage coverage{.frames = frames_ns.size(), .tracked = pairs.size()};
  coverage.before_first = pairs.empty() ? frames_ns.size() : pairs.front().first;
  coverage.lost = coverage.frames - coverage.tracked - coverage.before_first;
  return coverage;
}

FrameCoverage InferCoverage(std::span<const int64_t> poses_ns, int64_t truth_first_ns, int64_t truth_last_ns) {
  FrameCoverage coverage{.frames = poses_ns.size(), .tracked = poses_ns.size(), .inferred = true};
  const int64_t period_ns = MedianPeriod_ns(poses_ns);
  if (period_ns <= 0) return coverage;
  const auto frames_in = [&](int64_t duration_ns) {
    return static_cast<size_t>(std::max<int64_t>(0, (duration_ns + period_ns / 2) / period_ns));
  };
  coverage.before_first = frames_in(poses_ns.front() - truth_first_ns);
  const size_t expected = frames_in(std::max(poses_ns.back(), truth_last_ns) - poses_ns.front()) + 1;
  coverage.lost = expected - std::min(expected, coverage.tracked);
  coverage.frames = coverage.before_first + coverage.tracked + coverage.lost;
  return coverage;
}

}  // namespace romap::eval
