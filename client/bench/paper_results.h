#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "client/bench/methods.h"
#include "client/bench/published.h"
#include "client/bench/timed_training.h"

namespace romap::bench {

// The training time limit [s] of an evaluation at the end of the training plan.
inline constexpr double kToTheEnd_s = -1;

// One object of one evaluation.
struct ObjectTraining {
  std::string object;
  int views = 0;
  int steps = 0;
  double train_s = 0;  // by the clock of the benchmark
  double wall_s = 0;
  double setup_s = 0;
  double mesh_s = 0;                                     // surface extraction, by the clock for one thread
  double sampling_s = 0, forward_s = 0, backward_s = 0;  // CPU time of all threads
  uint64_t samples = 0;
  bool limited = false;  // the training plan was shortened to fit the limit
  std::string fault;     // reason why there is no mesh; empty if there is one
};

// The comparison with the truth of all objects, trained with one method and one seed on one subset of the frames.
struct Evaluation {
  std::string method;
  double limit_s = kToTheEnd_s;
  int seed = 1;
  int subset = 0;
  std::vector<ObjectTraining> objects = {};
  // The mean of the "seen" figures of `romap eval map`; nullopt if nothing could be measured.
  std::optional<PublishedQuality> quality = {};
  size_t matched = 0;     // number of objects with figures
  std::string note = {};  // reason why there are no figures
};

// One point of a convergence curve: means over the objects after the given training time per object.
struct CurvePoint {
  std::string method;
  double train_s = 0;
  double accuracy_cm = 0, completion_cm = 0;
};

// A table of the report.
struct BenchTable {
  std::string id;  // "1", "4", "ablation"
  std::vector<BenchMethod> methods;
};

// The complete or partial results of the benchmark.
struct PaperResults {
  std::string sequence;
  size_t objects = 0;  // of the sequence
  int frames_per_subset = 0;
  int threads = 2;
  BenchClock clock = BenchClock::kCpu;
  double cap_s = 0;
  std::vector<double> times_s;          // training times at which the quality is measured, besides the end
  int runs_planned = 0, runs_done = 0;  // of (seed, subset)
  std::vector<double> fma_peak_gflops;  // sum over all threads, measured between runs
  std::vector<BenchTable> tables;
  std::vector<std::string> notes;
  std::vector<Evaluation> evaluations;
  std::vector<CurvePoint> curves;
};

// Means over the evaluations of one method with one time limit.
struct MethodMean {
  int evaluations = 0;
  PublishedQuality quality{}, spread{};                                 // mean, and standard deviation over evaluations
  double steps = 0, train_s = 0, wall_s = 0, setup_s = 0, mesh_ms = 0;  // per object
  double sampling_ms = 0, forward_ms = 0, backward_ms = 0, iteration_ms = 0;  // per step, CPU time / threads
  double samples_per_s = 0;  // training samples of all threads, by the clock
  double found_share = 0;    // share of objects with figures
  bool limited = false;      // some training plan was shortened
};

// nullopt if there is no evaluation with figures.
std::optional<MethodMean> MeanOf(const PaperResults& results, const std::string& method, double limit_s);

// Median of the measured peak rates [GFLOP/s]; 0 if there are none.
double FmaPeak(const PaperResults& results);

// The report as Markdown tables, and all figures as JSON.
std::string ToMarkdown(const PaperResults& results);
std::string ToJsonText(const PaperResults& results);

}  // namespace romap::bench
