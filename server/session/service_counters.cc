#include "server/session/service_counters.h"

#include <algorithm>

namespace romap::session {

void ServiceCounters::CountAcknowledged(double latency_s) {
  const auto& bounds = LatencyHistogram::kBounds_s;
  ++latencies_[static_cast<size_t>(std::ranges::lower_bound(bounds, latency_s) - bounds.begin())];
  latency_sum_s_.fetch_add(latency_s);
}

ServiceMetrics ServiceCounters::Read() const {
  ServiceMetrics metrics;
  metrics.frames_received = received_;
  metrics.frames_processed = processed_;
  metrics.frames_dropped = dropped_;
  metrics.frames_rejected = rejected_;
  std::ranges::copy(latencies_, metrics.tracking_latency.counts.begin());
  metrics.tracking_latency.sum_s = latency_sum_s_;
  return metrics;
}

}  // namespace romap::session
