#include "server/slam/local_adjuster.h"

#include <algorithm>
#include <utility>

#include "common/thread_priority.h"

namespace romap::slam {
namespace {

constexpr int kMaxLocalIterations = 8;  // enough to converge

}  // namespace

void LocalAdjuster::Adjust(const MapKeyframe& newest, SlamMap& map) {
  waiting_ = newest.id;
  if (!run_) StartWaiting(map);
  if (run_inline_) Finish(map);
}

bool LocalAdjuster::Apply(bool wait, SlamMap& map) {
  bool changed = false;
  if (!run_ && waiting_) StartWaiting(map);
  while (run_ && (wait || run_->IsFinished())) {
    run_->Wait();
    changed |= Finish(map);
    if (waiting_) StartWaiting(map);
  }
  return changed;
}

void LocalAdjuster::Move(const Sim3<World, World>& S_new_old) {
  if (run_) run_->Move(S_new_old);
}

void LocalAdjuster::Discard() {
  if (!run_) return;
  aborted_.Add(std::move(run_));
  if (!waiting_) waiting_ = running_;
}

void LocalAdjuster::Reset() {
  aborted_.Add(std::move(run_));
  waiting_ = {};
}

void LocalAdjuster::StartWaiting(const SlamMap& map) {
  running_ = std::exchange(waiting_, {});
  const MapKeyframe* newest = map.FindKeyframe(running_);
  if (newest == nullptr) return;  // it was redundant
  const auto solve = [](BundleProblem& problem, const std::atomic<bool>& abort) {
    return AdjustBundle(problem, {.max_iterations = kMaxLocalIterations, .dense = true, .abort = &abort});
  };
  run_ =
      std::make_unique<AdjustmentRun>(WindowProblem(map, *newest, config_), solve, run_inline_, kLocalAdjustmentNice);
}

// Requires a finished run.
bool LocalAdjuster::Finish(SlamMap& map) {
  if (!run_) return false;
  const bool usable = run_->summary().usable;
  if (usable) ApplyWindow(run_->TakeSolution(), map);
  ++times_.runs;
  times_.total_s += run_->time_s();
  times_.longest_s = std::max(times_.longest_s, run_->time_s());
  run_ = nullptr;
  return usable;
}

}  // namespace romap::slam
