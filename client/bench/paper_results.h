#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "client/bench/methods.h"
#include "client/bench/published.h"
#include "client/bench/timed_training.h"

namespace romap::bench {

// How long an evaluation's training was allowed to take [s]; the last one stands for "to the end of the plan".
inline constexpr double kToTheEnd_s = -1;

// One object of one evaluation.
struct ObjectTraining {
  std::string object;
  int views = 0;
  int steps = 0;
  double train_s = 0;  // by the bench's clock
  double wall_s = 0;
  double setup_s = 0;
  double mesh_s = 0;                                     // of extracting the surface, by the clock of one thread
  double sampling_s = 0, forward_s = 0, backward_s = 0;  // CPU time of all threads
  uint64_t samples = 0;
  bool limited = false;  // the plan was cut to fit the time
  std::string fault;     // why there is no mesh; empty when there is one
};

// All objects of the sequence by one method with one seed on one subset of the frames, held against the truth.
struct Evaluation {
  std::string method;
  double limit_s = kToTheEnd_s;
  int seed = 1;
  int subset = 0;
  std::vector<ObjectTraining> objects = {};
  // Mean row, seen columns, of `romap eval map`; nullopt when nothing could be measured.
  std::optional<PublishedQuality> quality = {};
  size_t matched = 0;     // objects that have figures
  std::string note = {};  // why there are none
};

// One point of a convergence curve: means over the objects after so much training each.
struct CurvePoint {
  std::string method;
  double train_s = 0;
  double accuracy_cm = 0, completion_cm = 0;
};

// A table of the report: its methods and what they are called.
struct BenchTable {
  std::string id;  // "1", "4", "ablation"
  std::vector<BenchMethod> methods;
};

// Everything a run of the benchmark found out, complete or not.
struct PaperResults {
  std::string sequence;
  size_t objects = 0;  // of the sequence
  int frames_per_subset = 0;
  int threads = 2;
  BenchClock clock = BenchClock::kCpu;
  double cap_s = 0;
  std::vector<double> times_s;          // at which quality is taken besides the end
  int runs_planned = 0, runs_done = 0;  // of (seed, subset)
  std::vector<double> fma_peak_gflops;  // of all threads together, measured again and again
  std::vector<BenchTable> tables;
  std::vector<std::string> notes;
  std::vector<Evaluation> evaluations;
  std::vector<CurvePoint> curves;
};

// Means over the evaluations of one method at one limit.
struct MethodMean {
  int evaluations = 0;
  PublishedQuality quality{}, spread{};                                 // mean, and standard deviation over evaluations
  double steps = 0, train_s = 0, wall_s = 0, setup_s = 0, mesh_ms = 0;  // per object
  double sampling_ms = 0, forward_ms = 0, backward_ms = 0, iteration_ms = 0;  // per step, CPU time / threads
  double samples_per_s = 0;                                                   // trained, of all threads, by the clock
  double found_share = 0;                                                     // of the objects
  bool limited = false;                                                       // some plan was cut
};

// nullopt: there is no evaluation with figures.
std::optional<MethodMean> MeanOf(const PaperResults& results, const std::string& method, double limit_s);

// Median of the measured peaks [GFLOP/s]; 0 when there is none.
double FmaPeak(const PaperResults& results);

// The tables for people (Markdown) and all figures for programs (JSON text).
std::string ToMarkdown(const PaperResults& results);
std::string ToJsonText(const PaperResults& results);

}  // namespace romap::bench
