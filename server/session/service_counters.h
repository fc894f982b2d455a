#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "common/service_metrics.h"

namespace romap::session {

// The counters of all sessions of a service. Thread-safe.
class ServiceCounters {
 public:
  void CountReceived() { ++received_; }
  void CountProcessed() { ++processed_; }
  void CountDropped() { ++dropped_; }
  void CountRejected() { ++rejected_; }
  void CountAcknowledged(double latency_s);

  // Everything but the store.
  ServiceMetrics Read() const;

 private:
  std::atomic<uint64_t> received_ = 0, processed_ = 0, dropped_ = 0, rejected_ = 0;
  std::array<std::atomic<uint64_t>, LatencyHistogram::kBounds_s.size() + 1> latencies_ = {};
  std::atomic<double> latency_sum_s_ = 0;
};

}  // namespace romap::session
