#pragma once

#include <memory>

#include "server/slam/adjustment_run.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Local bundle adjustment around each new keyframe. In the background, a copy is adjusted while the map grows, so that
// new keyframes and their points need not wait for it. Not thread-safe.
class LocalAdjuster {
 public:
  // `run_inline`: every adjustment is finished when Adjust() returns.
  LocalAdjuster(const SlamConfig& config, bool run_inline) : config_(config), run_inline_(run_inline) {}

  // Adjusts around the keyframe. In the background: starts now, or after the pending run is applied.
  void Adjust(const MapKeyframe& newest, SlamMap& map);
  // In the background: writes a finished run to the map, and starts the next one if a keyframe waits for it. `wait`:
  // finishes all of them. Returns whether the map changed.
  bool Apply(bool wait, SlamMap& map);
  // The map was moved as a whole.
  void Move(const Sim3<World, World>& S_new_old);
  // The map was changed by something else. The window of the discarded run is adjusted again in Apply().
  void Discard();
  // Forgets everything about the map.
  void Reset();

  struct Times {
    int runs = 0;
    double total_s = 0;
    double longest_s = 0;
  };
  const Times& times() const { return times_; }

 private:
  void StartWaiting(const SlamMap& map);
  bool Finish(SlamMap& map);

  const SlamConfig config_;
  const bool run_inline_;
  std::unique_ptr<AdjustmentRun> run_;  // null: none is pending
  AbortedRuns aborted_;
  KeyframeId running_;  // the keyframe of `run_`
  KeyframeId waiting_;  // the newest keyframe that was not adjusted; 0: none
  Times times_;
};

}  // namespace romap::slam
