#pragma once

#include <cstddef>

#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Estimates the uncertainties of the keyframes' poses from the information of the whole map (BundleCovariances). A new
// keyframe starts with the uncertainty it was tracked with. Not thread-safe.
class UncertaintyEstimator {
 public:
  explicit UncertaintyEstimator(const SlamConfig& config) : config_(config) {}

  // The map changed as a whole: the next Update() must not be skipped.
  void RequestUpdate() { is_requested_ = true; }
  // Sets MapKeyframe::uncertainty of all keyframes, if this was requested or the map grew by a fifth since the last
  // time, which bounds the mean time per keyframe. `find_lens`: see GlobalProblem.
  void Update(bool find_lens, SlamMap& map);
  // Whether uncertainties were updated since the last call.
  bool TakeChange();

 private:
  const SlamConfig config_;
  bool is_requested_ = true;
  bool has_changed_ = false;
  size_t keyframes_ = 0;  // in the map at the last update
};

}  // namespace romap::slam
