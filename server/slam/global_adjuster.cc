#include "server/slam/global_adjuster.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>

#include "common/thread_priority.h"
#include "server/slam/map_adjustment.h"

namespace romap::slam {
namespace {

constexpr double kMinNoise = 0.2;  // of the assumed one

// Adjusts again with the measured noise instead of the assumed one, so that errors that are large for this camera and
// scene lose their influence. The observations remain classified by the assumed noise.
void AdjustWithMeasuredNoise(BundleProblem& problem, const BundleOptions& options) {
  const double noise = std::clamp(MeasureNoise(problem), kMinNoise, 1.0);
  for (BundleObservation& observation : problem.observations) observation.sigma_px *= noise;
  AdjustBundle(problem, options);
  for (BundleObservation& observation : problem.observations) observation.sigma_px /= noise;
  ClassifyOutliers(problem);
  spdlog::debug("slam: noise of observations {:.2f} of the assumed one", noise);
}

BundleSummary SolveGlobal(BundleProblem& problem, const std::atomic<bool>& abort) {
  const BundleOptions options{.max_iterations = 20, .function_tolerance = 1e-6, .abort = &abort};
  const BundleSummary summary = AdjustBundle(problem, options);
  if (summary.usable && !summary.aborted) AdjustWithMeasuredNoise(problem, options);
  return summary;
}

}  // namespace

void GlobalAdjuster::Start(const SlamMap& map, bool find_lens) {
  Cancel();
  run_ = std::make_unique<AdjustmentRun>(GlobalProblem(map, config_, find_lens), SolveGlobal, run_inline_,
                                         kGlobalAdjustmentNice);
}

std::optional<BundleFit> GlobalAdjuster::Fit(bool wait) const {
  if (wait) run_->Wait();
  if (!run_->IsFinished() || !run_->summary().usable) return std::nullopt;
  return MeasureFit(run_->bundle());
}

bool GlobalAdjuster::Apply(bool wait, SlamMap& map) {
  if (!run_ || (!wait && !run_->IsFinished())) return false;
  run_->Wait();
  const BundleSummary summary = run_->summary();
  const MapProblem solution = run_->TakeSolution();
  run_ = nullptr;
  spdlog::debug("slam: global bundle adjustment of {} keyframes and {} points: {:.2f} -> {:.2f} px",
                solution.keyframes.size(), solution.points.size(), summary.initial_rms_px, summary.final_rms_px);
  if (solution.bundle.lens) spdlog::debug("slam: lens k1 {:.4f}", solution.bundle.lens->correction.k1);
  if (summary.usable) ApplyGlobal(solution, map);
  return summary.usable;
}

}  // namespace romap::slam
