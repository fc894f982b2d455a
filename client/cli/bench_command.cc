#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "client/bench/paper_bench.h"
#include "client/cli/command.h"
#include "client/cli/interrupt.h"
#include "client/cli/progress.h"
#include "common/status.h"

namespace romap::cli {
namespace {

struct Options {
  bench::PaperBenchOptions bench;
  std::vector<std::string> rows;
  bool quick = false;
};

absl::Status RunBench(const Options& options) {
  bench::PaperBenchOptions bench = options.bench;
  for (const std::string& row : options.rows) {
    ROMAP_ASSIGN_OR_RETURN(bench::BenchMethod method, bench::ParseMethod(row));
    ROMAP_RETURN_IF_ERROR(bench::Configure(method, bench.settings).status());
    bench.more_methods.push_back(std::move(method));
  }
  if (options.quick) bench = bench::Quick(std::move(bench));
  Progress progress("bench paper");
  ROMAP_ASSIGN_OR_RETURN(
      const bench::PaperResults results,
      bench::RunPaperBench(
          bench, [&](double share, const std::string& text) { progress.Show(share, text); }, Interrupted));
  progress.Done();
  fmt::print("{}\nreport: {}/paper.md and paper.json\n", bench::ToMarkdown(results), bench.out_dir);
  if (results.runs_done == results.runs_planned) return absl::OkStatus();
  return absl::CancelledError(fmt::format("stopped after {} of {} runs; the report says what there is",
                                          results.runs_done, results.runs_planned));
}

void AddPaperPart(CLI::App& app, Command* chosen) {
  auto options = std::make_shared<Options>();
  bench::PaperBenchOptions& bench = options->bench;
  CLI::App* command = app.add_subcommand(
      "paper", "Tables 1, 3, 4, an ablation and the convergence plot (Fig. 8) of the paper on a sequence with truth");
  command->add_option("sequence", bench.sequence_dir, "Folder of the sequence, with objects.yaml and gt/")->required();
  command->add_option("--out", bench.out_dir, "Folder for paper.md, paper.json, convergence.png and meshes")
      ->required();
  command->add_flag("--quick", options->quick, "One seed, one subset, the default method and the visual hull");
  command->add_option("--seeds", bench.seeds, "Trainings of each object, each with another seed")
      ->capture_default_str();
  command->add_option("--subsets", bench.subsets, "Subsets of the frames: from the first, the second, ..")
      ->capture_default_str();
  command->add_option("--every", bench.every, "A subset takes every so many-th frame")->capture_default_str();
  command->add_option("--times", bench.times_s, "Training times at which quality is taken [s]")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--cap", bench.cap_s, "Longest training of one object [s]; longer plans are cut to fit")
      ->capture_default_str();
  command->add_option("--threads", bench.threads, "Threads that train one object")->capture_default_str();
  const std::map<std::string, bench::BenchClock> clocks = {{"cpu", bench::BenchClock::kCpu},
                                                           {"wall", bench::BenchClock::kWall}};
  command->add_option("--clock", bench.clock, "Time is CPU time over threads (other work does not count), or wall time")
      ->transform(CLI::CheckedTransformer(clocks))
      ->option_text("cpu|wall [cpu]");
  command->add_option("--tables", bench.tables, "Which tables; 1 brings 3 and the plot along")
      ->delimiter(',')
      ->check(CLI::IsMember({"1", "4", "ablation"}))
      ->capture_default_str();
  command->add_option("--methods", bench.methods, "Only these rows, by id")->delimiter(',');
  command->add_option("--set", bench.settings, "section.field=value for all rows, before their own; repeatable")
      ->allow_extra_args(false);
  command->add_option("--row", options->rows, "'NAME: nerf.field=value ..': one more row of Table 1; repeatable")
      ->allow_extra_args(false);
  command->callback([options, chosen] { *chosen = [options] { return RunBench(*options); }; });
}

}  // namespace

void AddBenchCommand(CLI::App& app, Command* chosen) {
  CLI::App* command = app.add_subcommand("bench", "Measure the field engine");
  command->require_subcommand(1);
  AddPaperPart(*command, chosen);
}

}  // namespace romap::cli
