#pragma once

#include <optional>

#include "server/slam/global_adjuster.h"
#include "server/slam/loop_detector.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Tries a loop on a copy of the map before the map itself changes: closes it there and adjusts the whole copy on a
// background thread. A true loop agrees with all earlier observations. A wrong one bends the map, so that observations
// become outliers. Not thread-safe.
class LoopTrial {
 public:
  LoopTrial(const SlamConfig& config, bool run_inline) : config_(config), adjuster_(config, run_inline) {}

  // Copies the map and starts the trial. `find_lens`: see GlobalProblem.
  void Start(const SlamMap& map, const LoopMatch& loop, bool scale_is_known, bool find_lens);
  // The map was moved as a whole.
  void Move(const Sim3<World, World>& S_new_old) { adjuster_.Move(S_new_old); }
  void Cancel();
  bool IsPending() const { return loop_.has_value(); }

  enum class Verdict { kPending, kRejected, kClosed };
  // When the trial is finished, closes the loop in the map it was started with, or rejects it. `wait`: blocks until it
  // is finished. Requires IsPending().
  Verdict Conclude(bool wait, SlamMap& map);
  // Requires IsPending().
  const LoopMatch& loop() const { return *loop_; }

 private:
  const SlamConfig config_;
  GlobalAdjuster adjuster_;
  std::optional<LoopMatch> loop_;
  bool scale_is_known_ = false;
  BundleFit before_;  // of the map without the loop
};

}  // namespace romap::slam
