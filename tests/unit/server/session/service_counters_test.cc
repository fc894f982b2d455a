#include "server/session/service_counters.h"

#include <gmock/gmock.h>

namespace romap::session::service_counters_test {

TEST(ServiceCountersTest, CountLatenciesByTheirBounds) {
  ServiceCounters counters;
  for (const double latency_s : {0.001, 0.005, 0.006, 0.3, 100.0}) counters.CountAcknowledged(latency_s);
  counters.CountReceived();
  counters.CountReceived();
  counters.CountDropped();
  const ServiceMetrics metrics = counters.Read();
  EXPECT_EQ(metrics.frames_received, 2u);
  EXPECT_EQ(metrics.frames_dropped, 1u);
  EXPECT_EQ(metrics.frames_rejected, 0u);
  const auto& counts = metrics.tracking_latency.counts;
  EXPECT_EQ(counts[0], 2u) << "a bound belongs to its interval";
  EXPECT_EQ(counts[1], 1u);
  EXPECT_EQ(counts[8], 1u) << "0.2 to 0.5 s";
  EXPECT_EQ(counts.back(), 1u);
  EXPECT_NEAR(metrics.tracking_latency.sum_s, 100.312, 1e-9);
}

}  // namespace romap::session::service_counters_test
