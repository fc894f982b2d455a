#include "client/bench/load_results.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "common/statistics.h"

namespace romap::bench {
namespace {

nlohmann::json ToJson(const Percentiles& times) {
  return {{"count", times.count},
          {"p50_ms", 1000 * times.p50},
          {"p90_ms", 1000 * times.p90},
          {"p99_ms", 1000 * times.p99},
          {"max_ms", 1000 * times.max}};
}

std::string ToText(const Percentiles& times) {
  if (times.count == 0) return fmt::format("{:>31}", "-");
  return fmt::format("{:7.1f} {:7.1f} {:7.1f} {:7.1f}", 1000 * times.p50, 1000 * times.p90, 1000 * times.p99,
                     1000 * times.max);
}

}  // namespace

Percentiles PercentilesOf(const std::vector<double>& values) {
  if (values.empty()) return {};
  return {.count = values.size(),
          .p50 = LowerQuantile(values, 0.5),
          .p90 = LowerQuantile(values, 0.9),
          .p99 = LowerQuantile(values, 0.99),
          .max = LowerQuantile(values, 1)};
}

double JainIndex(const std::vector<double>& amounts) {
  double sum = 0, squares = 0;
  for (const double amount : amounts) {
    sum += amount;
    squares += amount * amount;
  }
  return squares > 0 ? sum * sum / (static_cast<double>(amounts.size()) * squares) : 1;
}

double GrowthPercentPerMinute(const std::vector<MemorySample>& samples) {
  if (samples.empty()) return 0;
  const double begin_s = samples.front().time_s + (samples.back().time_s - samples.front().time_s) / 3;
  double count = 0, t = 0, b = 0, tt = 0, tb = 0;
  for (const MemorySample& sample : samples) {
    if (sample.time_s < begin_s) continue;
    ++count;
    t += sample.time_s;
    b += sample.bytes;
    tt += sample.time_s * sample.time_s;
    tb += sample.time_s * sample.bytes;
  }
  const double variance = count * tt - t * t;
  if (count < 3 || !(variance > 0) || !(b > 0)) return 0;
  const double bytes_per_s = (count * tb - t * b) / variance;
  return 100 * 60 * bytes_per_s / (b / count);
}

double LoadResults::TrainingFairness() const {
  std::vector<double> steps;
  for (const ClientLoad& client : clients) {
    if (client.refused.empty()) steps.push_back(static_cast<double>(client.training_steps));
  }
  return JainIndex(steps);
}

std::string ToText(const LoadResults& results) {
  std::string text = fmt::format("{:>6} {:>7} {:>7} {:>7} {:>7} {:>8} {:>7}   {:^31}   {:^31}\n", "client", "sent",
                                 "tracked", "dropped", "late", "steps", "objects", "acknowledged: 50 90 99 100 % [ms]",
                                 "stored: 50 90 99 100 % [ms]");
  int refused = 0;
  for (size_t i = 0; i < results.clients.size(); ++i) {
    const ClientLoad& client = results.clients[i];
    if (!client.refused.empty()) {
      ++refused;
      text += fmt::format("{:>6} refused: {}\n", i + 1, client.refused);
      continue;
    }
    text += fmt::format("{:>6} {:>7} {:>7} {:>7} {:>7} {:>8} {:>7}   {}   {}\n", i + 1, client.sent, client.tracked,
                        client.dropped, client.late, client.training_steps, client.objects,
                        ToText(PercentilesOf(client.ack_s)), ToText(PercentilesOf(client.durable_s)));
    if (!client.error.empty()) text += fmt::format("{:>6} ended early: {}\n", "", client.error);
  }
  uint64_t events = 0;
  for (const ViewerLoad& viewer : results.viewers) events += viewer.events;
  text += fmt::format(
      "{} clients at {:.0f} Hz for {:.0f} s, {} refused; {} viewers got {} events; {} viewers read nothing\n",
      results.clients.size(), results.rate_hz, results.duration_s, refused, results.viewers.size(), events,
      results.stalled_viewers);
  text += fmt::format("fairness of training (Jain, by steps): {:.3f}\n", results.TrainingFairness());
  if (!results.memory.empty()) {
    text += fmt::format("memory of the server: {:.0f} MB at the end, {:+.1f} % a minute after the first third\n",
                        results.memory.back().bytes / 1e6, GrowthPercentPerMinute(results.memory));
  }
  return text;
}

std::string ToJson(const LoadResults& results) {
  nlohmann::json json = {{"duration_s", results.duration_s},
                         {"rate_hz", results.rate_hz},
                         {"stalled_viewers", results.stalled_viewers},
                         {"training_fairness", results.TrainingFairness()},
                         {"memory_growth_percent_per_minute", GrowthPercentPerMinute(results.memory)},
                         {"clients", nlohmann::json::array()},
                         {"viewers", nlohmann::json::array()},
                         {"memory", nlohmann::json::array()}};
  for (const ClientLoad& client : results.clients) {
    json["clients"].push_back({{"refused", client.refused},
                               {"error", client.error},
                               {"sent", client.sent},
                               {"acknowledged", client.acknowledged},
                               {"tracked", client.tracked},
                               {"rejected", client.rejected},
                               {"dropped", client.dropped},
                               {"late", client.late},
                               {"training_steps", client.training_steps},
                               {"objects", client.objects},
                               {"acknowledged_after", ToJson(PercentilesOf(client.ack_s))},
                               {"stored_after", ToJson(PercentilesOf(client.durable_s))}});
  }
  for (const ViewerLoad& viewer : results.viewers) {
    json["viewers"].push_back({{"events", viewer.events}, {"error", viewer.error}});
  }
  for (const MemorySample& sample : results.memory) {
    json["memory"].push_back({{"time_s", sample.time_s}, {"bytes", sample.bytes}});
  }
  return json.dump(1) + "\n";
}

}  // namespace romap::bench
