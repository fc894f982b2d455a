#pragma once

#include <atomic>

#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Local bundle adjustment around each new keyframe. Not thread-safe, except RequestEarlyStop().
class LocalAdjuster {
 public:
  explicit LocalAdjuster(const SlamConfig& config) : config_(config) {}

  void Adjust(const MapKeyframe& newest, SlamMap& map);
  // From any thread: `stop` ends the current and the following adjustments early, but never two in a row.
  void RequestEarlyStop(bool stop) { stop_ = stop; }
  bool is_stop_requested() const { return stop_; }

  struct Times {
    int runs = 0;
    double total_s = 0;
    double longest_s = 0;
  };
  const Times& times() const { return times_; }

 private:
  const SlamConfig config_;
  std::atomic<bool> stop_ = false;
  bool last_was_stopped_ = false;
  Times times_;
};

}  // namespace romap::slam
