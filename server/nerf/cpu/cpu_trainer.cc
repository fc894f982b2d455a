#include "server/nerf/cpu/cpu_trainer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <optional>
#include <thread>

#include "common/thread_time.h"
#include "server/nerf/cpu/distance_fit.h"
#include "server/nerf/cpu/shape_probe.h"
#include "server/nerf/math/random.h"

namespace romap::nerf {
namespace {

constexpr int kChunkSamples = 1024;  // so that the activations of a chunk fit into the L2 cache

constexpr size_t kPrefetchVisits = 24;       // distance of the prefetch of occupancy cells
constexpr size_t kOptimizerBlock = 1 << 15;  // parameters per optimizer task

// Spacing of the points at which the shape of a signed-distance field is evaluated, box sides: at the first and the
// last step.
constexpr float kFirstSpacing = 0.02f;
constexpr float kLastSpacing = 0.01f;
constexpr uint64_t kShapeSeed = 77;

// Reading the CPU time of a thread is a system call, so only one chunk in kTimedChunk is timed by phase.
constexpr int kTimedChunk = 8;

}  // namespace

// Buffers for one share of the rays of a step and its gradients. There is one worker per thread.
struct CpuTrainer::Worker {
  Worker(const NerfConfig& config, const FieldModel& model)
      : chunk_rays(RaysThatFit(kChunkSamples, config.max_samples_per_ray)),
        chunk(kChunkSamples, model.layout.features, model.mlp.hidden),
        rays(static_cast<size_t>(chunk_rays)),
        spans(static_cast<size_t>(chunk_rays)),
        results(static_cast<size_t>(chunk_rays)),
        table_gradient(model.table.size() + kMaxLanes),
        mlp_gradient(model.mlp.parameters.size()),
        visits(static_cast<size_t>((config.rays_per_step + chunk_rays) * config.max_samples_per_ray)) {
    if (model.IsDistance()) shape.emplace(config, model);
  }

  void ResetStats() {
    phase_s = {};
    render_s = optimize_s = 0;
    object_rays = 0;
    stats = {};
  }
  // Adds the CPU time since the last call to `phase`, if the current chunk is timed.
  void AddPhaseTime(TrainPhase phase) {
    if (!timed) return;
    const double now_s = ThreadCpuSeconds();
    phase_s[static_cast<size_t>(phase)] += now_s - last_phase_end_s;
    last_phase_end_s = now_s;
  }
  // Distributes the time of all chunks over the phases in the proportions of the timed chunks.
  void DistributeRenderTime() {
    const double timed_s = std::accumulate(phase_s.begin(), phase_s.end(), 0.0);
    for (size_t p = 0; p < phase_s.size(); ++p) stats.phase_cpu_s[p] = phase_s[p] * render_s / std::max(1e-9, timed_s);
    stats.phase_cpu_s[static_cast<size_t>(TrainPhase::kOptimize)] = optimize_s;
  }

  struct Visit {
    uint32_t cell;
    float weight;
  };

  int chunk_rays;
  int ray_count = 0;
  SampleChunk chunk;
  std::vector<Ray> rays;
  std::vector<RaySpan> spans;
  std::vector<RayResult> results;
  AlignedBuffer<float> table_gradient, mlp_gradient;
  std::optional<ShapeProbe> shape;  // of signed-distance fields
  AlignedBuffer<Visit> visits;      // of one step, for the occupancy; the first visit_count are in use
  size_t visit_count = 0;
  bool timed = false;  // whether the current chunk is timed
  double last_phase_end_s = 0;
  std::array<double, static_cast<size_t>(TrainPhase::kCount)> phase_s = {};  // of timed chunks
  double render_s = 0;                                                       // of all chunks
  double optimize_s = 0;  // of the thread with the index of this worker
  uint64_t object_rays = 0;
  TrainStats stats;
};

CpuTrainer::CpuTrainer(const NerfConfig& config, uint64_t seed, const KernelTable& kernels)
    : config_(config),
      loss_weights_(MakeLossWeights(config)),
      budget_(MakeSampleBudget(config)),
      occupancy_plan_(MakeOccupancyPlan(config)),
      state_(config, seed),
      kernels_(&kernels.For(state_.model)) {}

CpuTrainer::~CpuTrainer() = default;
CpuTrainer::CpuTrainer(CpuTrainer&&) noexcept = default;
CpuTrainer& CpuTrainer::operator=(CpuTrainer&&) noexcept = default;

void CpuTrainer::FitDistances(const StepSource& source, std::span<const float> distance) {
  nerf::FitDistances(config_, *kernels_, source, distance, state_);
}

void CpuTrainer::ShrinkFeatures(float share) {
  FieldModel& model = state_.model;
  if (model.table.size() == 0) return;
  for (size_t i = 0; i < model.table.size(); ++i) model.table[i] *= share;
  for (size_t i = static_cast<size_t>(model.mlp.OutOffset()); i < model.mlp.parameters.size(); ++i) {
    model.mlp.parameters[i] /= share;
  }
  model.mlp.UpdateTransposed();
}

void CpuTrainer::ReleaseScratch() { workers_.clear(); }

TrainStats CpuTrainer::Run(const StepSource& source, Occupancy& occupancy, int steps, int threads) {
  const auto start = std::chrono::steady_clock::now();
  while (static_cast<int>(workers_.size()) < threads) {
    workers_.push_back(std::make_unique<Worker>(config_, state_.model));
  }
  for (int t = 0; t < threads; ++t) workers_[static_cast<size_t>(t)]->ResetStats();
  {
    const uint64_t optimizer_tasks = 1 + (state_.model.table.size() + kOptimizerBlock - 1) / kOptimizerBlock;
    StepTasks tasks(static_cast<uint64_t>(steps), {static_cast<uint64_t>(threads), optimizer_tasks});
    std::vector<std::jthread> helpers;
    for (int t = 1; t < threads; ++t) {
      helpers.emplace_back([&, t] { RunTasks(source, occupancy, t, threads, tasks); });
    }
    RunTasks(source, occupancy, 0, threads, tasks);
  }
  state_.steps_done += static_cast<uint64_t>(steps);
  if (state_.model.IsDistance()) state_.model.sharpness = SharpnessAt(source.progress(state_.steps_done));
  TrainStats total = CollectStats(threads, steps);
  total.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return total;
}

// Returns the statistics, summed over the workers.
TrainStats CpuTrainer::CollectStats(int threads, int steps) {
  TrainStats total;
  uint64_t object_rays = 0;
  for (int t = 0; t < threads; ++t) {
    Worker& worker = *workers_[static_cast<size_t>(t)];
    worker.DistributeRenderTime();
    total.rays += worker.stats.rays;
    total.samples += worker.stats.samples;
    total.active_samples += worker.stats.active_samples;
    total.color_loss += worker.stats.color_loss;
    object_rays += worker.object_rays;
    for (size_t p = 0; p < total.phase_cpu_s.size(); ++p) total.phase_cpu_s[p] += worker.stats.phase_cpu_s[p];
  }
  total.steps = steps;
  total.color_loss /= static_cast<double>(std::max<uint64_t>(1, object_rays));
  return total;
}

void CpuTrainer::RunTasks(const StepSource& source, Occupancy& occupancy, int thread, int shares, StepTasks& tasks) {
  double optimize_s = 0;
  while (const std::optional<StepTasks::Task> task = tasks.Next()) {
    if (task->phase == 0) {
      RenderShare(source, occupancy, task->step, static_cast<int>(task->index), shares);
    } else {
      const double start_s = ThreadCpuSeconds();
      Optimize(source, occupancy, state_.steps_done + task->step, task->index, shares);
      optimize_s += ThreadCpuSeconds() - start_s;
    }
    tasks.Finish();
  }
  workers_[static_cast<size_t>(thread)]->optimize_s = optimize_s;
}

// `round`: steps since the start of Run().
void CpuTrainer::RenderShare(const StepSource& source, const Occupancy& occupancy, uint64_t round, int share,
                             int shares) {
  Worker& worker = *workers_[static_cast<size_t>(share)];
  const double start_s = ThreadCpuSeconds();
  worker.visit_count = 0;
  const int chunks = (config_.rays_per_step + worker.chunk_rays - 1) / worker.chunk_rays;
  for (int chunk = share; chunk < chunks; chunk += shares) {
    worker.timed = (round + static_cast<uint64_t>(chunk / shares)) % kTimedChunk == 0;
    if (worker.timed) worker.last_phase_end_s = ThreadCpuSeconds();
    RenderChunk(source, occupancy, state_.steps_done + round, chunk * worker.chunk_rays, worker);
  }
  worker.render_s += ThreadCpuSeconds() - start_s;
}

void CpuTrainer::RenderChunk(const StepSource& source, const Occupancy& occupancy, uint64_t step, int first_ray,
                             Worker& worker) {
  const FieldModel& model = state_.model;
  SampleChunk& chunk = worker.chunk;
  worker.ray_count = std::min(worker.chunk_rays, config_.rays_per_step - first_ray);
  for (int r = 0; r < worker.ray_count; ++r) worker.rays[static_cast<size_t>(r)] = source.ray(step, first_ray + r);
  const SamplingRule rule{.occupied_bits = occupancy.bits(), .extent = source.extent, .budget = budget_};
  chunk.size = 0;
  kernels_->place_samples(worker.rays.data(), worker.ray_count, rule, chunk, worker.spans.data());
  kernels_->to_grid(source.grid, chunk.size, chunk.x.data(), chunk.y.data(), chunk.z.data());
  worker.AddPhaseTime(TrainPhase::kSampling);
  kernels_->encode(model.layout, model.table.data(), chunk.size, chunk.x.data(), chunk.y.data(), chunk.z.data(),
                   chunk.features.data());
  worker.AddPhaseTime(TrainPhase::kEncode);
  kernels_->mlp_forward(model.mlp, chunk.size, chunk.features.data(), chunk.hidden.data(), chunk.raw.data());
  worker.AddPhaseTime(TrainPhase::kMlp);
  kernels_->activate(chunk, model.density_bias);
  if (model.IsDistance()) {
    RenderDistances(source, step, first_ray, worker);
  } else {
    CompositeRays(worker);
  }
  // About half of the samples remain; the others are in empty space or behind the surface.
  const int active = kernels_->keep_active(static_cast<float>(config_.min_sample_gradient),
                                           1.0f / static_cast<float>(config_.rays_per_step), model.layout.features,
                                           model.mlp.hidden, chunk);
  worker.AddPhaseTime(TrainPhase::kRender);
  kernels_->mlp_backward(model.mlp, active, chunk.features.data(), chunk.hidden.data(), chunk.d_raw.data(),
                         worker.mlp_gradient.data());
  worker.AddPhaseTime(TrainPhase::kMlpBackward);
  kernels_->encode_backward(model.layout, active, chunk.x.data(), chunk.y.data(), chunk.z.data(), chunk.features.data(),
                            worker.table_gradient.data());
  worker.AddPhaseTime(TrainPhase::kEncodeBackward);
  worker.stats.samples += static_cast<uint64_t>(chunk.size);
  worker.stats.active_samples += static_cast<uint64_t>(active);
}

void CpuTrainer::CompositeRays(Worker& worker) {
  SampleChunk& c = worker.chunk;
  kernels_->composite(worker.rays.data(), worker.spans.data(), worker.ray_count, loss_weights_, c,
                      worker.results.data());
  Worker::Visit* visit = worker.visits.data() + worker.visit_count;
  worker.visit_count += static_cast<size_t>(c.size);
  for (size_t r = 0; r < static_cast<size_t>(worker.ray_count); ++r) {
    const size_t first = static_cast<size_t>(worker.spans[r].first), count = static_cast<size_t>(worker.spans[r].count);
    if (count == 0) continue;
    for (size_t i = first; i < first + count; ++i) *visit++ = {c.cell[i], c.weight[i]};
    ++worker.stats.rays;
    if (worker.rays[r].target.is_object) {
      worker.stats.color_loss += worker.results[r].color_loss;
      ++worker.object_rays;
    }
  }
}

// The sharpness increases by the same factor with every step.
float CpuTrainer::SharpnessAt(float progress) const {
  const double first = config_.initial_sharpness;
  return static_cast<float>(first * std::pow(config_.final_sharpness / first, progress));
}

void CpuTrainer::RenderDistances(const StepSource& source, uint64_t step, int first_ray, Worker& worker) {
  const float progress = source.progress(step), sharpness = SharpnessAt(progress);
  SampleChunk& chunk = worker.chunk;
  kernels_->distance_opacity(worker.spans.data(), worker.ray_count, sharpness, chunk);
  CompositeRays(worker);
  kernels_->distance_backward(worker.spans.data(), worker.ray_count, sharpness, chunk);
  const float spacing = kFirstSpacing * std::pow(kLastSpacing / kFirstSpacing, progress);
  worker.shape->AddGradients(
      state_.model, *kernels_, chunk, {worker.spans.data(), static_cast<size_t>(worker.ray_count)}, spacing,
      RandomBits(kShapeSeed, step, static_cast<uint64_t>(first_ray)), 1.0f / static_cast<float>(config_.rays_per_step),
      worker.table_gradient.data(), worker.mlp_gradient.data());
}

// Task 0 is the work that only one thread can do, so it starts first; the other tasks are blocks of the hash table.
void CpuTrainer::Optimize(const StepSource& source, Occupancy& occupancy, uint64_t step, uint64_t task, int shares) {
  const AdamRates rates = MakeAdamRates(config_, source.learning_rate(step));
  FieldModel& model = state_.model;
  std::array<float*, kMaxThreads> gradients;
  if (task == 0) {
    for (int t = 0; t < shares; ++t) gradients[t] = workers_[static_cast<size_t>(t)]->mlp_gradient.data();
    kernels_->adam(rates, 0, model.mlp.parameters.size(), model.mlp.parameters.data(), state_.mlp_first.data(),
                   state_.mlp_second.data(), gradients.data(), shares);
    model.mlp.UpdateTransposed();
    UpdateOccupancy(occupancy, step, shares);
    return;
  }
  for (int t = 0; t < shares; ++t) gradients[t] = workers_[static_cast<size_t>(t)]->table_gradient.data();
  const size_t begin = (task - 1) * kOptimizerBlock;
  kernels_->adam(rates, begin, std::min(model.table.size(), begin + kOptimizerBlock), model.table.data(),
                 state_.table_first.data(), state_.table_second.data(), gradients.data(), shares);
}

void CpuTrainer::UpdateOccupancy(Occupancy& occupancy, uint64_t step, int shares) {
  for (int t = 0; t < shares; ++t) {
    const Worker& worker = *workers_[static_cast<size_t>(t)];
    for (size_t i = 0; i < worker.visit_count; ++i) {
      occupancy.Prefetch(worker.visits[std::min(i + kPrefetchVisits, worker.visit_count - 1)].cell);
      occupancy.Record(worker.visits[i].cell, worker.visits[i].weight);
    }
  }
  if (OccupancyUpdateIsDue(occupancy_plan_, step + 1)) occupancy.Update();
}

}  // namespace romap::nerf
