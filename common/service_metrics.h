#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace romap {

// How many frames were acknowledged within which time.
struct LatencyHistogram {
  static constexpr std::array<double, 12> kBounds_s = {0.005, 0.01, 0.02, 0.03, 0.05, 0.075, 0.1, 0.2, 0.5, 1, 2, 5};
  // Number of frames up to each bound that are above the one before; the last one: above all bounds.
  std::array<uint64_t, kBounds_s.size() + 1> counts = {};
  double sum_s = 0;
};

// Counters of a service since it was started, over all sessions, also deleted ones. Inputs of a stored session that are
// read again count again.
struct ServiceMetrics {
  uint64_t frames_received = 0;
  uint64_t frames_processed = 0;
  uint64_t frames_dropped = 0;
  uint64_t frames_rejected = 0;
  LatencyHistogram tracking_latency = {};  // from the arrival of a frame to its acknowledgment
  // What waits for the disk; 0 without a store.
  uint64_t store_waiting_bytes = 0;
  double store_oldest_wait_s = 0;
};

}  // namespace romap
