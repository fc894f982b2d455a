#pragma once

#include <cstddef>
#include <optional>
#include <set>

#include "server/slam/global_adjuster.h"
#include "server/slam/map_joint.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Tries the merge of two maps on a copy before the maps themselves change: joins them there and adjusts the whole copy
// on a background thread. If the maps do show a common place, the points that were merged there agree with all their
// observations from both maps. Not thread-safe.
class MergeTrial {
 public:
  // `run_inline`: the trial is finished when Start() returns.
  MergeTrial(const SlamConfig& config, bool run_inline) : config_(config), adjuster_(config, run_inline) {}

  // Copies the maps that the joint names and starts the trial. Returns false if too few of their points are the same.
  bool Start(const MapJoint& joint, const SlamMap& from, const SlamMap& into);
  void Cancel();
  bool IsPending() const { return merged_.has_value(); }

  // Whether the merge is confirmed; nullopt while the trial is not finished. Ends it. `wait`: blocks until it is
  // finished. Requires IsPending().
  std::optional<bool> Conclude(bool wait);

 private:
  // Points that keyframes of both maps observe.
  size_t CountSharedPoints() const;

  const SlamConfig config_;
  GlobalAdjuster adjuster_;
  std::optional<SlamMap> merged_;  // while the trial is pending
  std::set<KeyframeId> moved_;     // the keyframes of `from`
  BundleFit before_;               // of both maps
  size_t shared_before_ = 0;       // points, before the adjustment
};

}  // namespace romap::slam
