#include "server/slam/local_adjuster.h"

#include <algorithm>
#include <chrono>

#include "server/slam/map_adjustment.h"

namespace romap::slam {
namespace {

constexpr int kMaxLocalIterations = 8;  // enough to converge

}  // namespace

void LocalAdjuster::Adjust(const MapKeyframe& newest, SlamMap& map) {
  const auto begin = std::chrono::steady_clock::now();
  MapProblem problem = WindowProblem(map, newest, config_);
  // At least every second adjustment runs to completion.
  const std::atomic<bool>* abort = last_was_stopped_ ? nullptr : &stop_;
  const BundleSummary summary =
      AdjustBundle(problem.bundle, {.max_iterations = kMaxLocalIterations, .dense = true, .abort = abort});
  last_was_stopped_ = summary.aborted;
  if (summary.usable) ApplyWindow(problem, map);
  const double time_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  ++times_.runs;
  times_.total_s += time_s;
  times_.longest_s = std::max(times_.longest_s, time_s);
}

}  // namespace romap::slam
