#include "server/http/metrics.h"

#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>
#include <unistd.h>

#include <fstream>
#include <utility>

#include "common/version.h"

namespace romap::http {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;
using Labels = std::vector<ClientMetric::Label>;

class Families {
 public:
  // Begins a family; the next values belong to it.
  Families& Begin(const char* name, const char* help, MetricType type) {
    MetricFamily& family = families_.emplace_back();
    family.name = name;
    family.help = help;
    family.type = type;
    return *this;
  }
  Families& Counter(const char* name, const char* help) { return Begin(name, help, MetricType::Counter); }
  Families& Gauge(const char* name, const char* help) { return Begin(name, help, MetricType::Gauge); }
  Families& Add(double value, Labels labels = {}) {
    MetricFamily& family = families_.back();
    ClientMetric& metric = family.metric.emplace_back();
    metric.label = std::move(labels);
    (family.type == MetricType::Counter ? metric.counter.value : metric.gauge.value) = value;
    return *this;
  }
  void AddHistogram(const LatencyHistogram& histogram) {
    ClientMetric& metric = families_.back().metric.emplace_back();
    uint64_t count = 0;
    for (size_t i = 0; i < histogram.kBounds_s.size(); ++i) {
      count += histogram.counts[i];
      metric.histogram.bucket.push_back({.cumulative_count = count, .upper_bound = histogram.kBounds_s[i]});
    }
    metric.histogram.sample_count = count + histogram.counts.back();
    metric.histogram.sample_sum = histogram.sum_s;
  }
  std::string Text() const { return prometheus::TextSerializer().Serialize(families_); }

 private:
  std::vector<MetricFamily> families_;
};

const char* NameOf(SessionState state) {
  switch (state) {
    case SessionState::kOpen:
      return "open";
    case SessionState::kFinishing:
      return "finishing";
    case SessionState::kFinished:
      return "finished";
    case SessionState::kFailed:
      return "failed";
    case SessionState::kRestoring:
      return "restoring";
  }
  return "unknown";
}

double ResidentBytes() {
  std::ifstream statm("/proc/self/statm");
  double pages_total = 0, pages_resident = 0;
  statm >> pages_total >> pages_resident;
  return pages_resident * static_cast<double>(sysconf(_SC_PAGESIZE));
}

// Finished sessions change no more, and there may be many of them.
bool IsRunning(const SessionInfo& info) {
  return info.state == SessionState::kFinishing || info.state == SessionState::kRestoring ||
         (info.state == SessionState::kOpen && (info.stream_open || info.statistics.objects_training > 0));
}

void AddSessions(const std::vector<SessionInfo>& sessions, Families* families) {
  std::map<SessionState, int> by_state;
  for (const SessionState state : {SessionState::kOpen, SessionState::kFinishing, SessionState::kFinished,
                                   SessionState::kFailed, SessionState::kRestoring}) {
    by_state[state] = 0;
  }
  double stored_bytes = 0;
  for (const SessionInfo& info : sessions) {
    ++by_state[info.state];
    stored_bytes += static_cast<double>(info.stored_bytes);
  }
  families->Gauge("romap_sessions", "Sessions by state");
  for (const auto& [state, count] : by_state) families->Add(count, {{.name = "state", .value = NameOf(state)}});
  families->Gauge("romap_store_bytes", "Bytes on the disk of all sessions").Add(stored_bytes);

  const auto of_each = [&](const char* name, const char* help, const std::function<double(const Statistics&)>& value) {
    families->Gauge(name, help);
    for (const SessionInfo& info : sessions) {
      if (IsRunning(info)) families->Add(value(info.statistics), {{.name = "session", .value = info.id}});
    }
  };
  of_each("romap_session_frames_waiting", "Frames that are received but not yet mapped", [](const Statistics& s) {
    const uint64_t settled = s.frames_processed + s.frames_dropped + s.frames_rejected;
    return static_cast<double>(s.frames_received > settled ? s.frames_received - settled : 0);
  });
  of_each("romap_session_keyframes", "Keyframes of the map",
          [](const Statistics& s) { return static_cast<double>(s.keyframes); });
  of_each("romap_session_map_points", "Points of the sparse map",
          [](const Statistics& s) { return static_cast<double>(s.map_points); });
  of_each("romap_session_objects", "Confirmed objects",
          [](const Statistics& s) { return static_cast<double>(s.objects); });
  of_each("romap_session_objects_training", "Objects with training steps left",
          [](const Statistics& s) { return static_cast<double>(s.objects_training); });
  of_each("romap_session_training_steps", "Training steps that were made",
          [](const Statistics& s) { return static_cast<double>(s.training_steps); });
  of_each("romap_session_training_progress_ratio", "Progress of the training of all objects, 0 to 1",
          [](const Statistics& s) { return s.training_progress; });
}

void AddService(const ServiceMetrics& service, Families* families) {
  families->Counter("romap_frames_received_total", "Frames received").Add(static_cast<double>(service.frames_received));
  families->Counter("romap_frames_processed_total", "Frames mapped").Add(static_cast<double>(service.frames_processed));
  families->Counter("romap_frames_dropped_total", "Frames dropped in live sessions because the server was too busy")
      .Add(static_cast<double>(service.frames_dropped));
  families->Counter("romap_frames_rejected_total", "Malformed frames")
      .Add(static_cast<double>(service.frames_rejected));
  families
      ->Begin("romap_tracking_latency_seconds", "Time from the arrival of a frame to its acknowledgment",
              MetricType::Histogram)
      .AddHistogram(service.tracking_latency);
  families->Gauge("romap_store_waiting_bytes", "Bytes that wait for the disk")
      .Add(static_cast<double>(service.store_waiting_bytes));
  families->Gauge("romap_store_oldest_wait_seconds", "Time that the oldest write has waited for the disk")
      .Add(service.store_oldest_wait_s);
}

}  // namespace

void Metrics::CountResponse(int code) {
  std::lock_guard lock(mutex_);
  ++responses_[code];
}

void Metrics::SetGauges(const HttpGauges& gauges) {
  std::lock_guard lock(mutex_);
  gauges_ = gauges;
}

std::string Metrics::Text(const std::vector<SessionInfo>& sessions) const {
  Families families;
  families.Gauge("romap_build_info", "The version, as a label").Add(1, {{.name = "version", .value = Version()}});
  families.Gauge("process_resident_memory_bytes", "Resident memory of the server").Add(ResidentBytes());
  AddSessions(sessions, &families);
  if (sources_.service) AddService(sources_.service(), &families);
  if (sources_.grpc_connections) {
    families.Gauge("romap_grpc_connections", "Open gRPC connections").Add(sources_.grpc_connections());
  }
  std::lock_guard lock(mutex_);
  families.Counter("romap_http_responses_total", "HTTP responses by code");
  for (const auto& [code, count] : responses_) {
    families.Add(static_cast<double>(count), {{.name = "code", .value = std::to_string(code)}});
  }
  families.Gauge("romap_http_connections", "Open HTTP connections").Add(static_cast<double>(gauges_.connections));
  families.Gauge("romap_http_viewers", "Open event streams").Add(static_cast<double>(gauges_.viewers));
  families.Gauge("romap_http_mesh_cache_bytes", "Meshes kept for viewers")
      .Add(static_cast<double>(gauges_.mesh_cache_bytes));
  return families.Text();
}

}  // namespace romap::http
