#include "client/bench/paper_bench.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <utility>

#include "client/bench/convergence_plot.h"
#include "client/bench/fma_peak.h"
#include "client/bench/method_runner.h"
#include "client/files/text_file.h"

namespace romap::bench {
namespace {

namespace fs = std::filesystem;

absl::Status Validate(const PaperBenchOptions& options) {
  if (options.seeds < 1) return InvalidArgument("seeds is {}; expected at least 1", options.seeds);
  if (options.every < 1) return InvalidArgument("every is {}; expected at least 1", options.every);
  if (options.subsets < 1 || options.subsets > options.every) {
    return InvalidArgument("subsets is {}; expected 1 to {} (the value of every)", options.subsets, options.every);
  }
  if (options.threads < 1 || options.threads > 64) {
    return InvalidArgument("threads is {}; expected 1 to 64", options.threads);
  }
  if (!(options.cap_s > 0)) return InvalidArgument("cap is {} s; expected a positive number", options.cap_s);
  double before_s = 0;
  for (const double time_s : options.times_s) {
    if (!(time_s > before_s))
      return InvalidArgument("times contain {} s; expected positive, ascending numbers", time_s);
    before_s = time_s;
  }
  return absl::OkStatus();
}

// All tables with all methods, including the additional rows of `options`.
absl::StatusOr<std::vector<BenchTable>> AllTables(const PaperBenchOptions& options) {
  std::vector<BenchTable> tables = {{"1", Table1Methods()}, {"4", ModelSizeMethods()}, {"ablation", AblationMethods()}};
  std::set<std::string> known;
  for (const BenchTable& table : tables) {
    for (const BenchMethod& method : table.methods) known.insert(method.id);
  }
  for (const BenchMethod& method : options.more_methods) {
    if (!known.insert(method.id).second) return InvalidArgument("row '{}' already exists", method.id);
    ROMAP_RETURN_IF_ERROR(Configure(method, options.settings).status());
    tables.front().methods.push_back(method);
  }
  for (const std::string& id : options.methods) {
    if (!known.contains(id))
      return InvalidArgument("unknown method '{}'; expected one of {}", id, fmt::join(known, ", "));
  }
  return tables;
}

bool Contains(const std::vector<std::string>& chosen, const std::string& id) {
  return std::ranges::find(chosen, id) != chosen.end();
}

// The selected tables with the selected methods.
absl::StatusOr<std::vector<BenchTable>> ChooseTables(const PaperBenchOptions& options) {
  ROMAP_ASSIGN_OR_RETURN(std::vector<BenchTable> tables, AllTables(options));
  std::erase_if(tables, [&](const BenchTable& table) { return !Contains(options.tables, table.id); });
  for (BenchTable& table : tables) {
    std::erase_if(table.methods, [&](const BenchMethod& method) {
      return !options.methods.empty() && !Contains(options.methods, method.id);
    });
    for (const BenchMethod& method : table.methods) {
      ROMAP_RETURN_IF_ERROR(Configure(method, options.settings).status());
    }
  }
  std::erase_if(tables, [](const BenchTable& table) { return table.methods.empty(); });
  if (tables.empty()) return InvalidArgument("no method selected");
  return tables;
}

class PaperBench {
 public:
  PaperBench(const PaperBenchOptions& options, const files::Sequence& sequence,
             const std::function<void(double, const std::string&)>& progress, const std::function<bool()>& stop)
      : options_(options),
        sequence_(sequence),
        progress_(progress),
        stop_(stop),
        runner_(sequence, options.out_dir + "/scratch", options.threads, options.clock) {}

  absl::StatusOr<PaperResults> Run() {
    ROMAP_RETURN_IF_ERROR(Configure(BenchMethod(), options_.settings).status());
    ROMAP_ASSIGN_OR_RETURN(results_.tables, ChooseTables(options_));
    Prepare();
    const absl::Status status = AllRuns();
    std::error_code error;
    fs::remove_all(options_.out_dir + "/scratch", error);
    if (!status.ok() && !absl::IsCancelled(status)) return status;
    if (!status.ok()) {
      results_.notes.push_back("Interrupted: some rows are incomplete.");
      ROMAP_RETURN_IF_ERROR(WriteReport());
    }
    return std::move(results_);
  }

 private:
  void Prepare() {
    results_.sequence = fs::path(options_.sequence_dir).lexically_normal().filename().string();
    results_.objects = sequence_.objects()->objects.size();
    results_.threads = options_.threads;
    results_.clock = options_.clock;
    results_.cap_s = options_.cap_s;
    results_.times_s = options_.times_s;
    std::erase_if(results_.times_s, [&](double time_s) { return time_s >= options_.cap_s; });
    results_.runs_planned = options_.seeds * options_.subsets;
    for (const BenchTable& table : results_.tables) methods_ += table.methods.size();
  }

  // Runs all subsets before the next seed, so that partial results are balanced.
  absl::Status AllRuns() {
    for (int seed = 1; seed <= options_.seeds; ++seed) {
      for (int subset = 0; subset < options_.subsets; ++subset) {
        ROMAP_RETURN_IF_ERROR(OneRun(seed, subset));
        ++results_.runs_done;
        ROMAP_RETURN_IF_ERROR(WriteReport());
      }
    }
    return absl::OkStatus();
  }

  absl::Status OneRun(int seed, int subset) {
    ROMAP_ASSIGN_OR_RETURN(TrueFrames frames, LoadTrueFrames(sequence_, options_.every, subset));
    results_.frames_per_subset = static_cast<int>(frames.size());
    runner_.SetFrames(std::move(frames));
    std::map<std::vector<std::string>, Evaluation> ends;  // final evaluations of this run by KeyOf()
    for (const BenchTable& table : results_.tables) {
      for (const BenchMethod& method : table.methods) {
        if (stop_()) return absl::CancelledError("interrupted");
        ROMAP_RETURN_IF_ERROR(OneMethod(table, method, seed, subset, ends));
        ++methods_done_;
      }
    }
    return absl::OkStatus();
  }

  absl::Status OneMethod(const BenchTable& table, const BenchMethod& method, int seed, int subset,
                         std::map<std::vector<std::string>, Evaluation>& ends) {
    if (!method.trained && seed > 1) return absl::OkStatus();  // the same for every seed
    ROMAP_ASSIGN_OR_RETURN(const EngineConfig config, Configure(method, options_.settings));
    const std::vector<std::string> key = KeyOf(method, config);
    if (const auto known = ends.find(key); table.id != "1" && known != ends.end()) {
      results_.evaluations.push_back(known->second);
      results_.evaluations.back().method = method.id;
      return absl::OkStatus();
    }
    results_.fma_peak_gflops.push_back(MeasureFmaPeakGflops(options_.threads));
    const bool first = seed == 1 && subset == 0;
    MethodRun run{.method = method, .config = config, .seed = seed, .subset = subset};
    if (table.id == "1") run.limits_s = results_.times_s;
    run.limits_s.push_back(options_.cap_s);
    run.with_curve = first && table.id == "1" && method.trained;
    if (first) run.keep_dir = options_.out_dir + "/meshes/" + method.id;
    const double fraction =
        static_cast<double>(methods_done_) / static_cast<double>(methods_ * static_cast<size_t>(results_.runs_planned));
    const auto report = [&](const std::string& object) {
      progress_(fraction, fmt::format("seed {}, subset {}: {}, {}", seed, subset, method.id, object));
    };
    ROMAP_ASSIGN_OR_RETURN(const MethodOutcome outcome, runner_.Run(run, report, stop_));
    results_.evaluations.insert(results_.evaluations.end(), outcome.evaluations.begin(), outcome.evaluations.end());
    results_.curves.insert(results_.curves.end(), outcome.curve.begin(), outcome.curve.end());
    ends.insert_or_assign(key, outcome.evaluations.back());
    return absl::OkStatus();
  }

  // Methods with equal keys have the same settings.
  static std::vector<std::string> KeyOf(const BenchMethod& method, EngineConfig config) {
    ConfigFields fields;
    config.nerf.Fields(fields);
    config.mesh.Fields(fields);
    return {fields.DumpYaml(), method.with_depth ? "depth" : "", method.trained ? "trained" : ""};
  }

  absl::Status WriteReport() const {
    ROMAP_RETURN_IF_ERROR(files::WriteFile(options_.out_dir + "/paper.md", ToMarkdown(results_)));
    ROMAP_RETURN_IF_ERROR(files::WriteFile(options_.out_dir + "/paper.json", ToJsonText(results_)));
    if (results_.curves.empty()) return absl::OkStatus();
    std::vector<uint8_t> png;
    cv::imencode(".png", DrawConvergence(results_), png);
    return files::WriteFile(options_.out_dir + "/convergence.png",
                            std::string_view(reinterpret_cast<const char*>(png.data()), png.size()));
  }

  const PaperBenchOptions& options_;
  const files::Sequence& sequence_;
  const std::function<void(double, const std::string&)>& progress_;
  const std::function<bool()>& stop_;
  MethodRunner runner_;
  PaperResults results_;
  size_t methods_ = 0;       // of one run
  size_t methods_done_ = 0;  // of all runs
};

}  // namespace

PaperBenchOptions Quick(PaperBenchOptions options) {
  options.seeds = options.subsets = 1;
  options.times_s = {1};
  options.tables = {"1"};
  if (options.methods.empty()) options.methods = {"fast", "hull"};
  for (const BenchMethod& method : options.more_methods) options.methods.push_back(method.id);
  return options;
}

absl::StatusOr<PaperResults> RunPaperBench(const PaperBenchOptions& options,
                                           const std::function<void(double, const std::string&)>& progress,
                                           const std::function<bool()>& stop) {
  ROMAP_RETURN_IF_ERROR(Validate(options));
  ROMAP_ASSIGN_OR_RETURN(const files::Sequence sequence,
                         files::Sequence::Open(options.sequence_dir, {.use_depth = true}));
  if (!sequence.objects())
    return NotFound("{}/objects.yaml does not exist; it must contain the true cuboids", options.sequence_dir);
  if (!fs::is_directory(options.sequence_dir + "/gt")) {
    return NotFound("{}/gt: no such folder; it must contain the true surfaces", options.sequence_dir);
  }
  ROMAP_RETURN_IF_ERROR(files::MakeFolder(options.out_dir));
  return PaperBench(options, sequence, progress, stop).Run();
}

}  // namespace romap::bench
