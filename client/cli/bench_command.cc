#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "client/bench/load_bench.h"
#include "client/bench/paper_bench.h"
#include "client/cli/command.h"
#include "client/cli/interrupt.h"
#include "client/cli/progress.h"
#include "client/cli/sequence_arguments.h"
#include "client/cli/service_options.h"
#include "client/files/text_file.h"
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
          bench, [&](double fraction, const std::string& text) { progress.Show(fraction, text); }, Interrupted));
  progress.Done();
  fmt::print("{}\nreport: {}/paper.md and paper.json\n", bench::ToMarkdown(results), bench.out_dir);
  if (results.runs_done == results.runs_planned) return absl::OkStatus();
  return absl::CancelledError(
      fmt::format("interrupted after {} of {} runs; wrote a partial report", results.runs_done, results.runs_planned));
}

void AddPaperSubcommand(CLI::App& app, Command* chosen) {
  auto options = std::make_shared<Options>();
  bench::PaperBenchOptions& bench = options->bench;
  CLI::App* command = app.add_subcommand(
      "paper",
      "Reproduce Tables 1, 3 and 4 and the convergence plot (Fig. 8) of the RO-MAP paper, and run an ablation");
  command->add_option("sequence", bench.sequence_dir, "Sequence folder with objects.yaml and gt/")->required();
  command->add_option("--out", bench.out_dir, "Output folder for paper.md, paper.json, convergence.png and meshes")
      ->required();
  command->add_flag("--quick", options->quick, "Run only one seed, one subset, the default method and the visual hull");
  command->add_option("--seeds", bench.seeds, "Number of trainings per object, each with a different seed")
      ->capture_default_str();
  command->add_option("--subsets", bench.subsets, "Number of frame subsets; subset k starts at frame k")
      ->capture_default_str();
  command->add_option("--every", bench.every, "A subset contains every n-th frame")->capture_default_str();
  command->add_option("--times", bench.times_s, "Training times at which the quality is measured [s]")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--cap", bench.cap_s, "Maximum training time per object [s]; longer training plans are shortened")
      ->capture_default_str();
  command->add_option("--threads", bench.threads, "Number of threads that train one object")->capture_default_str();
  const std::map<std::string, bench::BenchClock> clocks = {{"cpu", bench::BenchClock::kCpu},
                                                           {"wall", bench::BenchClock::kWall}};
  command
      ->add_option("--clock", bench.clock,
                   "Clock for training times: CPU time divided by the number of threads, or wall time")
      ->transform(CLI::CheckedTransformer(clocks))
      ->option_text("cpu|wall [cpu]");
  command->add_option("--tables", bench.tables, "Tables to compute: 1 (includes 3 and the plot), 4, ablation")
      ->delimiter(',')
      ->check(CLI::IsMember({"1", "4", "ablation"}))
      ->capture_default_str();
  command->add_option("--methods", bench.methods, "Run only the methods with these IDs")->delimiter(',');
  command
      ->add_option("--set", bench.settings,
                   "Configuration value for all methods, section.field=value; methods may override it; repeatable")
      ->allow_extra_args(false);
  command->add_option("--row", options->rows, "Additional row of Table 1, 'NAME: nerf.field=value ...'; repeatable")
      ->allow_extra_args(false);
  command->callback([options, chosen] { *chosen = [options] { return RunBench(*options); }; });
}

struct LoadCommand {
  bench::LoadOptions load;
  SequenceArguments sequence;
  ServiceOptions service;
  std::string json_file;
};

absl::Status RunLoad(const LoadCommand& command) {
  ROMAP_ASSIGN_OR_RETURN(const files::Sequence sequence, command.sequence.Open());
  ROMAP_ASSIGN_OR_RETURN(const std::unique_ptr<MappingService> service, command.service.Connect());
  Progress progress("bench load");
  ROMAP_ASSIGN_OR_RETURN(
      const bench::LoadResults results,
      bench::RunLoadBench(
          sequence, *service, command.load,
          [&](double fraction, const std::string& text) { progress.Show(fraction, text); }, Interrupted));
  progress.Done();
  fmt::print("{}", bench::ToText(results));
  if (!command.json_file.empty()) ROMAP_RETURN_IF_ERROR(files::WriteFile(command.json_file, bench::ToJson(results)));
  return Interrupted() ? absl::CancelledError("interrupted; these are the figures until then") : absl::OkStatus();
}

void AddLoadSubcommand(CLI::App& app, Command* chosen) {
  auto options = std::make_shared<LoadCommand>();
  CLI::App* command = app.add_subcommand(
      "load", "Load a server with live clients and viewers, and measure latency, drops, fairness and memory");
  options->sequence.AddSourceTo(*command);
  options->service.AddTo(*command, /*offer_local=*/true);
  bench::LoadOptions& load = options->load;
  command->add_option("--clients", load.clients, "Number of clients, each with a session of its own")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command->add_option("--viewers", load.viewers, "Number of viewers that read all events")
      ->check(CLI::Range(0, 10000))
      ->capture_default_str();
  command->add_option("--stalled", load.stalled_viewers, "Number of viewers that never read")
      ->check(CLI::Range(0, 10000))
      ->capture_default_str();
  command->add_option("--rate", load.rate_hz, "Frames per second of each client")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  command->add_option("--seconds", load.duration_s, "Duration; 1800 for a soak test")
      ->check(CLI::Range(1.0, 1e6))
      ->capture_default_str();
  command->add_flag_callback(
      "--no-poses", [&load] { load.pose_use = PoseUse::kIgnore; },
      "Send no camera poses, so that the server tracks the cameras from the images");
  command->add_option("--json", options->json_file, "Write all figures to this file");
  command->callback([options, chosen] { *chosen = [options] { return RunLoad(*options); }; });
}

}  // namespace

void AddBenchCommand(CLI::App& app, Command* chosen) {
  CLI::App* command = app.add_subcommand("bench", "Run benchmarks");
  command->require_subcommand(1);
  AddPaperSubcommand(*command, chosen);
  AddLoadSubcommand(*command, chosen);
}

}  // namespace romap::cli
