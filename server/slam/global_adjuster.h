#pragma once

#include <memory>
#include <optional>

#include "server/slam/adjustment_run.h"
#include "server/slam/optimize/bundle_adjustment.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Global bundle adjustment: adjusts a copy of the whole map on a background thread while the map keeps growing, and
// writes the result back later. At most one run at a time. Not thread-safe.
class GlobalAdjuster {
 public:
  // `run_inline`: Start() solves on the calling thread, so that the same frames give the same map.
  GlobalAdjuster(const SlamConfig& config, bool run_inline) : config_(config), run_inline_(run_inline) {}

  // Copies the map and starts to adjust it; cancels an earlier run. `find_lens`: see GlobalProblem.
  void Start(const SlamMap& map, bool find_lens);
  // Discards the run, finished or not. The map does not change.
  void Cancel() { aborted_.Add(std::move(run_)); }
  // The map was moved as a whole.
  void Move(const Sim3<World, World>& S_new_old) {
    if (run_) run_->Move(S_new_old);
  }
  // True after Start() until the run is applied or canceled.
  bool IsPending() const { return run_ != nullptr; }
  // The fit of the pending run's solution; nullopt while it is not finished, or if the solver failed. `wait`: blocks
  // until it is finished. Requires IsPending().
  std::optional<BundleFit> Fit(bool wait) const;
  bool IsFinished() const { return run_ && run_->IsFinished(); }
  // Writes the result of the pending run to the map it was started with. `wait`: blocks until the run is finished.
  // Returns whether the map changed: false without a pending or finished run, or if the solver failed.
  bool Apply(bool wait, SlamMap& map);

 private:
  const SlamConfig config_;
  const bool run_inline_;
  std::unique_ptr<AdjustmentRun> run_;
  AbortedRuns aborted_;
};

}  // namespace romap::slam
