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
  int seeds = 5;    // of the training
  int subsets = 3;  // of the frames: every `every`-th from 0, 1, ..
  int every = 4;
  int threads = 2;
  BenchClock clock = BenchClock::kCpu;
  std::vector<double> times_s = {1, 5};  // ascending: training times at which quality is taken
  double cap_s = 20;                     // longest training of one object
  std::vector<std::string> tables = {"1", "4", "ablation"};
  std::vector<std::string> methods = {};       // ids; empty = all
  std::vector<std::string> settings = {};      // "section.field=value" before each method's own
  std::vector<BenchMethod> more_methods = {};  // rows that are added to Table 1
};

// `options` for a first look: one seed, one subset, the default method and the hull, quality after a second.
PaperBenchOptions Quick(PaperBenchOptions options);

// Regenerates the paper's Tables 1, 3 and 4, an ablation and the convergence plot of Fig. 8 for a sequence with ground
// truth: trains its objects by all methods on the same true views and holds the surfaces against the truth. Writes
// paper.md, paper.json and convergence.png into out_dir, anew after each run (seed and subset), and the meshes of the
// first one into out_dir/meshes/METHOD/objects.
//
// `progress` is called with the share done (0..1) and what comes next; `stop` is asked now and then and ends the
// benchmark with what there is: then the results say fewer runs done than planned. INVALID_ARGUMENT: options, settings
// or the sequence are wrong. NOT_FOUND: a file is missing. What goes wrong with one object is told in the results.
absl::StatusOr<PaperResults> RunPaperBench(const PaperBenchOptions& options,
                                           const std::function<void(double, const std::string&)>& progress,
                                           const std::function<bool()>& stop);

}  // namespace romap::bench
