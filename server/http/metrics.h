#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "common/mapping_service.h"
#include "common/service_metrics.h"

namespace romap::http {

// Numbers that only other parts of the program know. Each may be empty. Called on the workers' threads.
struct MetricSources {
  std::function<ServiceMetrics()> service = {};
  std::function<int()> grpc_connections = {};
};

// The state of the HTTP server.
struct HttpGauges {
  size_t viewers = 0;
  size_t connections = 0;
  size_t mesh_cache_bytes = 0;
};

// Counts responses, and writes all metrics of the server as text for Prometheus. Thread-safe.
class Metrics {
 public:
  explicit Metrics(MetricSources sources) : sources_(std::move(sources)) {}

  void CountResponse(int code);
  void SetGauges(const HttpGauges& gauges);
  // Series with the label `session` exist as long as the session. `sessions`: all of the service.
  std::string Text(const std::vector<SessionInfo>& sessions) const;

 private:
  const MetricSources sources_;
  mutable std::mutex mutex_;
  std::map<int, uint64_t> responses_;  // by code
  HttpGauges gauges_;
};

}  // namespace romap::http
