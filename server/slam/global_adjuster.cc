#include "server/slam/global_adjuster.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <thread>

#include "common/thread_priority.h"
#include "server/slam/map_adjustment.h"

namespace romap::slam {
namespace {

constexpr double kMinNoise = 0.2;  // of the assumed one

}  // namespace

struct GlobalAdjuster::Run {
  void Solve() {
    const BundleOptions options{.max_iterations = 20, .function_tolerance = 1e-6, .abort = &abort};
    summary = AdjustBundle(problem.bundle, options);
    if (summary.usable && !summary.aborted) AdjustWithMeasuredNoise(options);
    done = true;
  }

  // Adjusts again with the measured noise instead of the assumed one, so that errors that are large for this camera and
  // scene lose their influence. The observations remain classified by the assumed noise.
  void AdjustWithMeasuredNoise(const BundleOptions& options) {
    const double noise = std::clamp(MeasureNoise(problem.bundle), kMinNoise, 1.0);
    for (BundleObservation& observation : problem.bundle.observations) observation.sigma_px *= noise;
    AdjustBundle(problem.bundle, options);
    for (BundleObservation& observation : problem.bundle.observations) observation.sigma_px /= noise;
    ClassifyOutliers(problem.bundle);
    spdlog::debug("slam: noise of observations {:.2f} of the assumed one", noise);
  }

  MapProblem problem;
  BundleSummary summary;  // valid once `done`
  std::atomic<bool> abort = false;
  std::atomic<bool> done = false;
  std::thread thread;
};

GlobalAdjuster::GlobalAdjuster(const SlamConfig& config, bool run_inline) : config_(config), run_inline_(run_inline) {}

GlobalAdjuster::~GlobalAdjuster() { Cancel(); }

void GlobalAdjuster::Start(const SlamMap& map, bool find_lens) {
  Cancel();
  run_ = std::make_unique<Run>();
  run_->problem = GlobalProblem(map, config_, find_lens);
  if (run_inline_) return run_->Solve();
  run_->thread = std::thread([run = run_.get()] {
    LowerThreadPriority();
    run->Solve();
  });
}

void GlobalAdjuster::Cancel() {
  if (!run_) return;
  run_->abort = true;
  if (run_->thread.joinable()) run_->thread.join();
  run_ = nullptr;
}

bool GlobalAdjuster::IsFinished() const { return run_ && run_->done; }

std::optional<BundleFit> GlobalAdjuster::Fit(bool wait) const {
  if (wait && run_->thread.joinable()) run_->thread.join();
  if (!run_->done || !run_->summary.usable) return std::nullopt;
  return MeasureFit(run_->problem.bundle);
}

bool GlobalAdjuster::Apply(bool wait, SlamMap& map) {
  if (!run_ || (!wait && !run_->done)) return false;
  if (run_->thread.joinable()) run_->thread.join();
  const BundleSummary& summary = run_->summary;
  spdlog::debug("slam: global bundle adjustment of {} keyframes and {} points: {:.2f} -> {:.2f} px",
                run_->problem.keyframes.size(), run_->problem.points.size(), summary.initial_rms_px,
                summary.final_rms_px);
  if (run_->problem.bundle.lens) spdlog::debug("slam: lens k1 {:.4f}", run_->problem.bundle.lens->correction.k1);
  const bool usable = summary.usable;
  if (usable) ApplyGlobal(run_->problem, map);
  run_ = nullptr;
  return usable;
}

}  // namespace romap::slam
