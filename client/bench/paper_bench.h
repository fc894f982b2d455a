#pragma once

#include <functional>
#include <string>
#include <vector>

#include "client/bench/paper_results.h"
#include "common/status.h"

namespace romap::bench {

struct PaperBenchOptions {
  std::string sequence_dir;  // with objects.yaml, masks, poses and gt/
  std::string out_dir;
  int seeds = 5;    // training runs with different seeds
  int subsets = 3;  // frame subsets: every `every`-th frame from frame 0, 1, ...
  int every = 4;
  int threads = 2;
  BenchClock clock = BenchClock::kCpu;
  std::vector<double> times_s = {1, 5};  // training times at which the quality is measured, ascending
  double cap_s = 20;                     // maximum training time of one object
  std::vector<std::string> tables = {"1", "4", "ablation"};
  std::vector<std::string> methods = {};       // ids; empty = all
  std::vector<std::string> settings = {};      // "section.field=value" for all methods, which may override them
  std::vector<BenchMethod> more_methods = {};  // additional rows of Table 1
};

// Reduces `options` to a short run: one seed, one subset, the default method and the visual hull, quality after 1 s.
PaperBenchOptions Quick(PaperBenchOptions options);

// Reproduces Tables 1, 3 and 4 of the paper, an ablation and the convergence plot of Fig. 8 for a sequence with ground
// truth: trains its objects with all methods on the same true views and compares the surfaces with the truth. Writes
// paper.md, paper.json and convergence.png to out_dir after each run (seed and subset), and the meshes of the first run
// to out_dir/meshes/METHOD/objects.
//
// Calls `progress` with the completed fraction (0..1) and a description of the next step. Polls `stop`; if it returns
// true, returns the partial results, with fewer runs done than planned. INVALID_ARGUMENT: invalid options, settings or
// sequence. Otherwise as Sequence::Open and WriteFile. Errors of single objects are reported in the results.
absl::StatusOr<PaperResults> RunPaperBench(const PaperBenchOptions& options,
                                           const std::function<void(double, const std::string&)>& progress,
                                           const std::function<bool()>& stop);

}  // namespace romap::bench
