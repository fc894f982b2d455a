#include "client/bench/paper_results.h"

#include <algorithm>
#include <cmath>

#include "common/statistics.h"

namespace romap::bench {
namespace {

// Sets mean and standard deviation of one figure.
void Spread(const std::vector<const Evaluation*>& chosen, double PublishedQuality::*figure, MethodMean& mean) {
  double sum = 0, squares = 0;
  for (const Evaluation* e : chosen) sum += (*e->quality).*figure;
  const double n = static_cast<double>(chosen.size()), average = sum / n;
  for (const Evaluation* e : chosen) squares += std::pow((*e->quality).*figure - average, 2);
  mean.quality.*figure = average;
  mean.spread.*figure = chosen.size() > 1 ? std::sqrt(squares / (n - 1)) : 0.0;
}

void AddCosts(const std::vector<const Evaluation*>& chosen, int threads, MethodMean& mean) {
  double objects = 0, steps = 0, train_s = 0, samples = 0;
  for (const Evaluation* e : chosen) {
    for (const ObjectTraining& o : e->objects) {
      objects += 1;
      steps += o.steps;
      train_s += o.train_s;
      samples += static_cast<double>(o.samples);
      mean.wall_s += o.wall_s;
      mean.setup_s += o.setup_s;
      mean.mesh_ms += 1e3 * o.mesh_s;
      mean.sampling_ms += 1e3 * o.sampling_s / threads;
      mean.forward_ms += 1e3 * o.forward_s / threads;
      mean.backward_ms += 1e3 * o.backward_s / threads;
      mean.limited |= o.limited;
    }
  }
  if (objects == 0) return;
  mean.steps = steps / objects;
  mean.train_s = train_s / objects;
  for (double* total : {&mean.wall_s, &mean.setup_s, &mean.mesh_ms}) *total /= objects;
  if (steps == 0) return;
  for (double* total : {&mean.sampling_ms, &mean.forward_ms, &mean.backward_ms}) *total /= steps;
  mean.iteration_ms = 1e3 * train_s / steps;
  mean.samples_per_s = train_s > 0 ? samples / train_s : 0;
}

}  // namespace

std::optional<MethodMean> MeanOf(const PaperResults& results, const std::string& method, double limit_s) {
  std::vector<const Evaluation*> chosen;
  MethodMean mean;
  double matched = 0, expected = 0;
  for (const Evaluation& e : results.evaluations) {
    if (e.method != method || e.limit_s != limit_s) continue;
    matched += static_cast<double>(e.matched);
    expected += static_cast<double>(results.objects);
    if (e.quality) chosen.push_back(&e);
  }
  if (chosen.empty()) return std::nullopt;
  mean.evaluations = static_cast<int>(chosen.size());
  mean.found_share = expected > 0 ? matched / expected : 0;
  for (const auto figure : {&PublishedQuality::accuracy_cm, &PublishedQuality::completion_cm,
                            &PublishedQuality::below_04_percent, &PublishedQuality::below_1_percent}) {
    Spread(chosen, figure, mean);
  }
  AddCosts(chosen, results.threads, mean);
  return mean;
}

double FmaPeak(const PaperResults& results) {
  std::vector<double> peaks = results.fma_peak_gflops;
  return peaks.empty() ? 0 : Median(peaks);
}

}  // namespace romap::bench
