// Measures the time of training by phase and compares it with the limits of this machine and with the scalar kernels:
//   nerf_bench [SEQUENCE] [--preset fast|paper|both] [--set nerf.FIELD=VALUE ..] [--steps 0] [--repeats 5]
//              [--threads 2]
// Trains each object of SEQUENCE (true cuboids, poses, masks; every fourth frame) or, without one, of a synthetic
// world. Reports the fastest of `repeats` interleaved runs. On shared machines only the ratios of the times are
// meaningful. `steps` 0 = a default for each preset.
//
// The limit of a phase is the larger of two times, computed from the counted work of the method and the measured peak
// rates of one core: floating-point operations at the peak rate of multiply-adds, and memory accesses (random loads and
// updates of tables of the size of the model's; sequential access for the optimizer).
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "client/files/sequence.h"
#include "common/config.h"
#include "common/status.h"
#include "server/nerf/cpu/cpu_trainer.h"
#include "server/nerf/presets.h"
#include "server/nerf/ray_set.h"
#include "server/nerf/visual_hull.h"
#include "tests/bench/machine_limits.h"
#include "tests/bench/training_scene.h"

namespace romap::measure {
namespace {

constexpr int kPhases = static_cast<int>(nerf::TrainPhase::kCount);

struct Options {
  std::string sequence;
  std::string preset = "both";
  std::vector<std::string> assignments;
  int steps = 0;
  int repeats = 5;
  int threads = 2;
};

// One object to train.
struct Subject {
  nerf::TrainingBox box;
  std::vector<ObjectView> views;
};

absl::StatusOr<std::vector<Subject>> LoadSubjects(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const TrainingScene scene, LoadTrainingScene(path));
  std::vector<Subject> subjects;
  for (const files::ObjectRecord& object : scene.objects) {
    Subject subject;
    subject.box = nerf::TrainingBox::Around({object.T_world_object, object.half_extents, 1.0},
                                            nerf::NerfConfig().box_enlargement);
    subject.views = bench::MakeTrueViews(scene.frames, object, /*with_depth=*/false);
    if (!subject.views.empty()) subjects.push_back(std::move(subject));
  }
  return subjects;
}

// Trains a new field for the subject.
nerf::TrainStats TrainOnce(const Subject& subject, const nerf::NerfConfig& config, const nerf::KernelTable& kernels,
                           int steps, int threads) {
  nerf::VisualHull hull(config);
  hull.Reset(subject.box);
  for (const ObjectView& view : subject.views) hull.Add(view);
  nerf::Occupancy occupancy(config);
  occupancy.SetHull(hull.Carve());
  nerf::RaySet rays(config, 1);
  rays.Build(subject.views, subject.box);
  nerf::CpuTrainer trainer(config, 1, kernels);
  const Eigen::Vector3f extent = subject.box.ExtentUnit();
  const double decay = std::log(config.final_learning_rate / config.learning_rate) / config.full_budget_steps;
  const nerf::StepSource source{
      .ray = [&](uint64_t step, int index) { return rays.Get(step, index); },
      .learning_rate =
          [&](uint64_t step) {
            return static_cast<float>(config.learning_rate * std::exp(decay * static_cast<double>(step)));
          },
      .extent = {extent.x(), extent.y(), extent.z()},
      .grid = subject.box.GridPose()};
  return trainer.Run(source, occupancy, steps, threads);
}

// Sums over subjects.
nerf::TrainStats TrainAll(const std::vector<Subject>& subjects, const nerf::NerfConfig& config,
                          const nerf::KernelTable& kernels, int steps, int threads) {
  nerf::TrainStats total;
  for (const Subject& subject : subjects) {
    const nerf::TrainStats stats = TrainOnce(subject, config, kernels, steps, threads);
    total.steps += stats.steps;
    total.rays += stats.rays;
    total.samples += stats.samples;
    total.active_samples += stats.active_samples;
    total.wall_s += stats.wall_s;
    for (size_t p = 0; p < kPhases; ++p) total.phase_cpu_s[p] += stats.phase_cpu_s[p];
  }
  return total;
}

double Rate(const nerf::TrainStats& stats) { return static_cast<double>(stats.samples) / stats.wall_s; }

// Peak rates of one core for a model of a given size.
struct Limits {
  double flop_s, probe_s, load_s, update_s, byte_s;
};

Limits MeasureLimits(const nerf::GridLayout& layout) {
  const size_t table_bytes = size_t{layout.entries} * nerf::kFeaturesPerLevel * sizeof(float);
  const size_t occupancy_bytes = size_t{1} << (3 * std::countr_zero(unsigned{nerf::kOccupancyResolution}) - 3);
  return {1 / PeakFlopPerSecond(), RandomLoadSeconds(occupancy_bytes), RandomLoadSeconds(table_bytes),
          RandomUpdateSeconds(table_bytes), 1 / StreamBytesPerSecond(4 * table_bytes)};
}

// Lower bound of the time of each phase per sample [s], for one thread.
std::array<double, kPhases> PhaseLimits(const nerf::NerfConfig& config, const nerf::TrainStats& stats,
                                        const Limits& limits) {
  const nerf::GridLayout layout = nerf::MakeGridLayout(config);
  const double samples = static_cast<double>(stats.samples);
  const double active = static_cast<double>(stats.active_samples) / samples;
  const double rays = stats.steps * static_cast<double>(config.rays_per_step) / samples;
  const double steps = stats.steps / samples;
  const double levels = config.levels, inputs = nerf::kFeaturesPerLevel * levels, hidden = config.hidden_width;
  const double probes = config.sampling == "occupied" ? nerf::kRayProbes * rays : 0;
  constexpr double kProbeFlop = 15, kRayFlop = 60, kPlacementFlop = 30;
  constexpr double kExponentialFlop = 16, kCompositeFlop = 60;
  constexpr double kCellFlop = 24, kBlendFlop = 36;  // of one level
  const double mlp_flop = 2 * (inputs * hidden + hidden * nerf::kOutputs);
  const double table_bytes = static_cast<double>(layout.entries) * nerf::kFeaturesPerLevel * sizeof(float);
  // The optimizer reads groups of eight adjacent entries; groups without a gradient are only read.
  const double groups = table_bytes / 64;
  const double touched = 1 - std::exp(-active * samples / stats.steps * levels * 4 / groups);
  const double bytes = steps * table_bytes * (1 + 7 * touched) / 2;  // pairs of one read and one write
  const double grid_flop = levels * (kCellFlop + kBlendFlop);
  return {std::max((probes * kProbeFlop + rays * kRayFlop + kPlacementFlop) * limits.flop_s, probes * limits.probe_s),
          std::max(grid_flop * limits.flop_s, levels * 4 * limits.load_s),
          mlp_flop * limits.flop_s,
          (5 * kExponentialFlop + kCompositeFlop) * limits.flop_s,
          active * 2 * mlp_flop * limits.flop_s,
          active * std::max(grid_flop * limits.flop_s, levels * 4 * limits.update_s),
          2 * bytes * limits.byte_s};
}

void PrintPhases(const nerf::TrainStats& one, const nerf::TrainStats& many, const std::array<double, kPhases>& limits) {
  double limit_sum = 0;
  std::printf("  %-12s %10s %10s %10s %7s\n", "phase", "1 thread", "all", "limit", "share");
  const auto row = [&](const char* name, double one_s, double many_s, double limit_s) {
    const double one_ns = one_s / static_cast<double>(one.samples) * 1e9;
    std::printf("  %-12s %10.1f %10.1f %10.1f %6.0f%%\n", name, one_ns,
                many_s / static_cast<double>(many.samples) * 1e9, limit_s * 1e9, 100 * limit_s * 1e9 / one_ns);
  };
  for (size_t p = 0; p < kPhases; ++p) {
    row(nerf::kTrainPhaseNames[p], one.phase_cpu_s[p], many.phase_cpu_s[p], limits[p]);
    limit_sum += limits[p];
  }
  row("all", one.CpuSeconds(), many.CpuSeconds(), limit_sum);
}

void BenchPreset(const char* name, const nerf::NerfConfig& config, int default_steps,
                 const std::vector<Subject>& subjects, const Options& options) {
  const int steps = options.steps > 0 ? options.steps : default_steps;
  const auto faster = [](const nerf::TrainStats& a, const nerf::TrainStats& b) { return Rate(a) > Rate(b) ? a : b; };
  nerf::TrainStats one, many, plain, short_run;
  one.wall_s = many.wall_s = plain.wall_s = short_run.wall_s = 1;
  const int plain_steps = std::max(1, steps / 20);
  for (int repeat = 0; repeat < options.repeats; ++repeat) {
    one = faster(one, TrainAll(subjects, config, nerf::SimdKernels(), steps, 1));
    many = faster(many, TrainAll(subjects, config, nerf::SimdKernels(), steps, options.threads));
    if (repeat > 1) continue;  // the scalar kernels are slow
    plain = faster(plain, TrainAll(subjects, config, nerf::PlainKernels(), plain_steps, 1));
    short_run = faster(short_run, TrainAll(subjects, config, nerf::SimdKernels(), plain_steps, 1));
  }
  const Limits limits = MeasureLimits(nerf::MakeGridLayout(config));
  std::printf("%s: %s kernels, %d steps, %.1f samples per ray, %.0f %% of them active\n", name,
              nerf::SimdKernels().name.c_str(), steps,
              static_cast<double>(one.samples) / (static_cast<double>(one.steps) * config.rays_per_step),
              100.0 * static_cast<double>(one.active_samples) / static_cast<double>(one.samples));
  std::printf("  peak rates of one core: %.0f GFLOP/s; random load %.2f ns, update %.2f ns; stream %.1f GB/s\n",
              1e-9 / limits.flop_s, 1e9 * limits.load_s, 1e9 * limits.update_s, 1e-9 / limits.byte_s);
  PrintPhases(one, many, PhaseLimits(config, one, limits));
  std::printf("  Msamples/s: 1 thread %.2f, %d threads %.2f; scaling %.2f; %.1f times the scalar kernels\n",
              1e-6 * Rate(one), options.threads, 1e-6 * Rate(many), Rate(many) / Rate(one),
              Rate(short_run) / Rate(plain));
  std::fflush(stdout);
}

absl::Status Run(const Options& options) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<Subject> subjects, LoadSubjects(options.sequence));
  nerf::NerfConfig fast, paper = *nerf::NerfPreset("paper");
  for (nerf::NerfConfig* config : {&fast, &paper}) {
    ConfigFields fields;
    fields.Section("nerf");
    config->Fields(fields);
    ROMAP_RETURN_IF_ERROR(fields.Load("", options.assignments));
  }
  std::printf("times in ns of CPU time per sample\n");
  if (options.preset != "paper") BenchPreset("fast", fast, 200, subjects, options);
  if (options.preset != "fast") BenchPreset("paper", paper, 20, subjects, options);
  return absl::OkStatus();
}

}  // namespace
}  // namespace romap::measure

int main(int argc, char** argv) {
  romap::measure::Options options;
  CLI::App app("Measures the time of training by phase and compares it with the limits of this machine");
  app.add_option("sequence", options.sequence);
  app.add_option("--preset", options.preset)->check(CLI::IsMember({"fast", "paper", "both"}));
  app.add_option("--set", options.assignments)->allow_extra_args(false);
  app.add_option("--steps", options.steps)->check(CLI::NonNegativeNumber);
  app.add_option("--repeats", options.repeats)->check(CLI::PositiveNumber);
  app.add_option("--threads", options.threads)->check(CLI::Range(1, 64));
  CLI11_PARSE(app, argc, argv);
  const absl::Status status = romap::measure::Run(options);
  if (!status.ok()) std::fprintf(stderr, "error: %s\n", romap::Message(status).c_str());
  return status.ok() ? 0 : 1;
}
