#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace romap::bench {

// Order statistics of times, in seconds; 0 without times.
struct Percentiles {
  size_t count = 0;
  double p50 = 0, p90 = 0, p99 = 0, max = 0;
};
Percentiles PercentilesOf(const std::vector<double>& values);

// Jain's fairness index of non-negative amounts: 1 if all are equal, 1/n if one of n has everything. 1 without amounts
// (Jain, Chiu, Hawe 1984).
double JainIndex(const std::vector<double>& amounts);

// One measurement of the memory of the server.
struct MemorySample {
  double time_s = 0;
  double bytes = 0;
};
// Growth by least squares over the samples after the first third, in percent of their mean per minute; 0 with fewer
// than three of them.
double GrowthPercentPerMinute(const std::vector<MemorySample>& samples);

// What one client of the load measured.
struct ClientLoad {
  std::string refused;  // why it got no session; empty: it got one
  std::string error;    // why its stream ended early; empty: it did not
  uint64_t sent = 0;
  uint64_t acknowledged = 0;
  uint64_t tracked = 0;   // with a pose
  uint64_t rejected = 0;  // malformed, or dropped by the server
  uint64_t dropped = 0;   // by the server, as it counts
  uint64_t late = 0;      // sent more than a period after they were due, because sending blocked
  uint64_t training_steps = 0;
  uint64_t objects = 0;                // confirmed
  std::vector<double> ack_s = {};      // from sending a frame to its acknowledgment
  std::vector<double> durable_s = {};  // from sending a frame to the word that it is stored
};

struct ViewerLoad {
  uint64_t events = 0;
  std::string error;
};

struct LoadResults {
  double duration_s = 0;
  double rate_hz = 0;
  int stalled_viewers = 0;
  std::vector<ClientLoad> clients = {};
  std::vector<ViewerLoad> viewers = {};  // those that read
  std::vector<MemorySample> memory = {};

  // Of the clients that got a session.
  double TrainingFairness() const;
};

// A table for people.
std::string ToText(const LoadResults& results);
// The same as JSON, with all figures.
std::string ToJson(const LoadResults& results);

}  // namespace romap::bench
