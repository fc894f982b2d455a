#include "server/slam/global_adjuster.h"

#include <spdlog/spdlog.h>

#include <atomic>
#include <thread>

#include "common/thread_priority.h"
#include "server/slam/map_adjustment.h"

namespace romap::slam {

struct GlobalAdjuster::Run {
  void Solve() {
    summary = AdjustBundle(problem.bundle, {.max_iterations = 20, .function_tolerance = 1e-6, .abort = &abort});
    done = true;
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
