#include "server/nerf/cpu/field_trainer.h"

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

constexpr int kChunkSamples = 1024;  // activations of a chunk stay in the second-level cache

constexpr float kMaxDepthError = 0.2f;  // box sides: larger depth errors are outliers

constexpr size_t kPrefetchVisits = 24;       // how far ahead cells of the occupancy are fetched
constexpr size_t kOptimiserBlock = 1 << 15;  // parameters that a thread takes at a time

// Of the points at which the shape of a signed-distance field is looked at, box sides: at the first step, at the last.
constexpr float kFirstSpacing = 0.02f;
constexpr float kLastSpacing = 0.01f;
constexpr uint64_t kShapeSeed = 77;

// Asking for the time of a thread is a call of the kernel: only one chunk in so many is timed by phase.
constexpr int kTimedChunk = 8;

}  // namespace

LossWeights MakeLossWeights(const NerfConfig& config) {
  LossWeights w;
  w.opacity_object = static_cast<float>(config.opacity_weight_object);
  w.opacity_background = static_cast<float>(config.opacity_weight_background);
  w.density = config.field == "density" ? static_cast<float>(config.density_weight) : 0.0f;
  w.depth = static_cast<float>(config.depth_weight);
  w.contrast = static_cast<float>(config.contrast_weight);
  w.depth_limit = kMaxDepthError;
  w.random_background = config.random_background;
  return w;
}

// What one share of the rays of a step is rendered with; its gradients. As many as there are threads.
struct FieldTrainer::Worker {
  Worker(const NerfConfig& config, const FieldModel& model)
      : chunk_rays(kChunkSamples / config.max_samples_per_ray / 2 * 2),  // pairs stay together
        chunk(kChunkSamples, model.layout.features, model.mlp.hidden),
        rays(static_cast<size_t>(chunk_rays)),
        spans(static_cast<size_t>(chunk_rays)),
        results(static_cast<size_t>(chunk_rays)),
        table_gradient(model.table.size() + kMaxLanes),
        mlp_gradient(model.mlp.parameters.size()),
        visits(static_cast<size_t>((config.rays_per_step + chunk_rays) * config.max_samples_per_ray)) {
    if (model.IsDistance()) shape.emplace(config, model);
  }

  void Begin() {
    phase_s = {};
    render_s = optimise_s = 0;
    object_rays = 0;
    stats = {};
  }
  // Books the CPU time since the last call to `phase`, if the chunk at work is timed.
  void Book(TrainPhase phase) {
    if (!timed) return;
    const double now_s = ThreadCpuSeconds();
    phase_s[static_cast<size_t>(phase)] += now_s - booked_until_s;
    booked_until_s = now_s;
  }
  // Divides the time that all chunks took among the phases as they shared the timed chunks.
  void ShareRenderTime() {
    const double timed_s = std::accumulate(phase_s.begin(), phase_s.end(), 0.0);
    for (size_t p = 0; p < phase_s.size(); ++p) stats.phase_cpu_s[p] = phase_s[p] * render_s / std::max(1e-9, timed_s);
    stats.phase_cpu_s[static_cast<size_t>(TrainPhase::kOptimise)] = optimise_s;
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
  bool timed = false;  // the chunk at work
  double booked_until_s = 0;
  std::array<double, static_cast<size_t>(TrainPhase::kCount)> phase_s = {};  // of timed chunks
  double render_s = 0;                                                       // of all chunks
  double optimise_s = 0;                                                     // of the thread of the same number
  uint64_t object_rays = 0;
  TrainStats stats;
};

FieldTrainer::FieldTrainer(const NerfConfig& config, uint64_t seed, const KernelTable& kernels)
    : config_(config),
      loss_weights_(MakeLossWeights(config)),
      model_(config, seed),
      kernels_(&kernels.For(model_)),
      table_first_(model_.table.size()),
      table_second_(model_.table.size()),
      mlp_first_(model_.mlp.parameters.size()),
      mlp_second_(model_.mlp.parameters.size()) {}

FieldTrainer::~FieldTrainer() = default;
FieldTrainer::FieldTrainer(FieldTrainer&&) noexcept = default;
FieldTrainer& FieldTrainer::operator=(FieldTrainer&&) noexcept = default;

void FieldTrainer::FitDistances(const StepSource& source, std::span<const float> distance) {
  nerf::FitDistances(config_, *kernels_, source, distance, state());
}

void FieldTrainer::Loosen(float share) {
  if (model_.table.size() == 0) return;
  for (size_t i = 0; i < model_.table.size(); ++i) model_.table[i] *= share;
  for (size_t i = static_cast<size_t>(model_.mlp.OutOffset()); i < model_.mlp.parameters.size(); ++i) {
    model_.mlp.parameters[i] /= share;
  }
  model_.mlp.UpdateTransposed();
}

void FieldTrainer::ReleaseScratch() { workers_.clear(); }

TrainStats FieldTrainer::Run(const StepSource& source, Occupancy& occupancy, int steps, int threads) {
  const auto start = std::chrono::steady_clock::now();
  while (static_cast<int>(workers_.size()) < threads) workers_.push_back(std::make_unique<Worker>(config_, model_));
  for (int t = 0; t < threads; ++t) workers_[static_cast<size_t>(t)]->Begin();
  {
    const uint64_t optimiser_tasks = 1 + (model_.table.size() + kOptimiserBlock - 1) / kOptimiserBlock;
    StepTasks tasks(static_cast<uint64_t>(steps), {static_cast<uint64_t>(threads), optimiser_tasks});
    std::vector<std::jthread> helpers;
    for (int t = 1; t < threads; ++t) {
      helpers.emplace_back([&, t] { RunTasks(source, occupancy, t, threads, tasks); });
    }
    RunTasks(source, occupancy, 0, threads, tasks);
  }
  steps_done_ += static_cast<uint64_t>(steps);
  if (model_.IsDistance()) model_.sharpness = SharpnessAt(source.progress(steps_done_));
  TrainStats total;
  uint64_t object_rays = 0;
  for (int t = 0; t < threads; ++t) {
    Worker& worker = *workers_[static_cast<size_t>(t)];
    worker.ShareRenderTime();
    total.rays += worker.stats.rays;
    total.samples += worker.stats.samples;
    total.active_samples += worker.stats.active_samples;
    total.color_loss += worker.stats.color_loss;
    object_rays += worker.object_rays;
    for (size_t p = 0; p < total.phase_cpu_s.size(); ++p) total.phase_cpu_s[p] += worker.stats.phase_cpu_s[p];
  }
  total.steps = steps;
  total.color_loss /= static_cast<double>(std::max<uint64_t>(1, object_rays));
  total.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return total;
}

void FieldTrainer::RunTasks(const StepSource& source, Occupancy& occupancy, int thread, int shares, StepTasks& tasks) {
  double optimise_s = 0;
  while (const std::optional<StepTasks::Task> task = tasks.Take()) {
    if (task->phase == 0) {
      RenderShare(source, occupancy, task->step, static_cast<int>(task->index), shares);
    } else {
      const double start_s = ThreadCpuSeconds();
      Optimise(source, occupancy, steps_done_ + task->step, task->index, shares);
      optimise_s += ThreadCpuSeconds() - start_s;
    }
    tasks.Finish();
  }
  workers_[static_cast<size_t>(thread)]->optimise_s = optimise_s;
}

// `round`: steps since Run() began.
void FieldTrainer::RenderShare(const StepSource& source, const Occupancy& occupancy, uint64_t round, int share,
                               int shares) {
  Worker& worker = *workers_[static_cast<size_t>(share)];
  const double start_s = ThreadCpuSeconds();
  worker.visit_count = 0;
  const int chunks = (config_.rays_per_step + worker.chunk_rays - 1) / worker.chunk_rays;
  for (int chunk = share; chunk < chunks; chunk += shares) {
    worker.timed = (round + static_cast<uint64_t>(chunk / shares)) % kTimedChunk == 0;
    if (worker.timed) worker.booked_until_s = ThreadCpuSeconds();
    RenderChunk(source, occupancy, steps_done_ + round, chunk * worker.chunk_rays, worker);
  }
  worker.render_s += ThreadCpuSeconds() - start_s;
}

void FieldTrainer::RenderChunk(const StepSource& source, const Occupancy& occupancy, uint64_t step, int first_ray,
                               Worker& worker) {
  SampleChunk& chunk = worker.chunk;
  worker.ray_count = std::min(worker.chunk_rays, config_.rays_per_step - first_ray);
  for (int r = 0; r < worker.ray_count; ++r) worker.rays[static_cast<size_t>(r)] = source.ray(step, first_ray + r);
  const SamplingRule rule{.occupied_bits = occupancy.bits(),
                          .extent = source.extent,
                          .finest_step = static_cast<float>(config_.min_sample_spacing),
                          .min_samples = std::min(config_.min_samples_per_ray, config_.max_samples_per_ray),
                          .max_samples = config_.max_samples_per_ray,
                          .skip_empty = config_.sampling == "occupied"};
  chunk.size = 0;
  kernels_->place_samples(worker.rays.data(), worker.ray_count, rule, chunk, worker.spans.data());
  kernels_->to_grid(source.grid, chunk.size, chunk.x.data(), chunk.y.data(), chunk.z.data());
  worker.Book(TrainPhase::kSampling);
  kernels_->encode(model_.layout, model_.table.data(), chunk.size, chunk.x.data(), chunk.y.data(), chunk.z.data(),
                   chunk.features.data());
  worker.Book(TrainPhase::kEncode);
  kernels_->mlp_forward(model_.mlp, chunk.size, chunk.features.data(), chunk.hidden.data(), chunk.raw.data());
  worker.Book(TrainPhase::kMlp);
  kernels_->activate(chunk, model_.density_bias);
  if (model_.IsDistance()) {
    RenderDistances(source, step, first_ray, worker);
  } else {
    CompositeRays(worker);
  }
  // About half of the samples remain: the others lie in empty space or behind the surface.
  const int active = kernels_->keep_active(static_cast<float>(config_.min_sample_gradient),
                                           1.0f / static_cast<float>(config_.rays_per_step), model_.layout.features,
                                           model_.mlp.hidden, chunk);
  worker.Book(TrainPhase::kRender);
  kernels_->mlp_backward(model_.mlp, active, chunk.features.data(), chunk.hidden.data(), chunk.d_raw.data(),
                         worker.mlp_gradient.data());
  worker.Book(TrainPhase::kMlpBackward);
  kernels_->encode_backward(model_.layout, active, chunk.x.data(), chunk.y.data(), chunk.z.data(),
                            chunk.features.data(), worker.table_gradient.data());
  worker.Book(TrainPhase::kEncodeBackward);
  worker.stats.samples += static_cast<uint64_t>(chunk.size);
  worker.stats.active_samples += static_cast<uint64_t>(active);
}

void FieldTrainer::CompositeRays(Worker& worker) {
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

// Surfaces get sharper by the same factor with every step.
float FieldTrainer::SharpnessAt(float progress) const {
  const double first = config_.initial_sharpness;
  return static_cast<float>(first * std::pow(config_.final_sharpness / first, progress));
}

void FieldTrainer::RenderDistances(const StepSource& source, uint64_t step, int first_ray, Worker& worker) {
  const float progress = source.progress(step), sharpness = SharpnessAt(progress);
  SampleChunk& chunk = worker.chunk;
  kernels_->distance_opacity(worker.spans.data(), worker.ray_count, sharpness, chunk);
  CompositeRays(worker);
  kernels_->distance_backward(worker.spans.data(), worker.ray_count, sharpness, chunk);
  const float spacing = kFirstSpacing * std::pow(kLastSpacing / kFirstSpacing, progress);
  worker.shape->AddGradients(model_, *kernels_, chunk, {worker.spans.data(), static_cast<size_t>(worker.ray_count)},
                             spacing, RandomBits(kShapeSeed, step, static_cast<uint64_t>(first_ray)),
                             1.0f / static_cast<float>(config_.rays_per_step), worker.table_gradient.data(),
                             worker.mlp_gradient.data());
}

// The first task is what must be done by one thread, so that it starts first; the others are blocks of the hash table.
void FieldTrainer::Optimise(const StepSource& source, Occupancy& occupancy, uint64_t step, uint64_t task, int shares) {
  const AdamRates rates{source.learning_rate(step), static_cast<float>(config_.adam_beta1),
                        static_cast<float>(config_.adam_beta2)};
  std::array<float*, kMostThreads> gradients;
  if (task == 0) {
    for (int t = 0; t < shares; ++t) gradients[t] = workers_[static_cast<size_t>(t)]->mlp_gradient.data();
    kernels_->adam(rates, 0, model_.mlp.parameters.size(), model_.mlp.parameters.data(), mlp_first_.data(),
                   mlp_second_.data(), gradients.data(), shares);
    model_.mlp.UpdateTransposed();
    UpdateOccupancy(occupancy, step, shares);
    return;
  }
  for (int t = 0; t < shares; ++t) gradients[t] = workers_[static_cast<size_t>(t)]->table_gradient.data();
  const size_t begin = (task - 1) * kOptimiserBlock;
  kernels_->adam(rates, begin, std::min(model_.table.size(), begin + kOptimiserBlock), model_.table.data(),
                 table_first_.data(), table_second_.data(), gradients.data(), shares);
}

void FieldTrainer::UpdateOccupancy(Occupancy& occupancy, uint64_t step, int shares) {
  for (int t = 0; t < shares; ++t) {
    const Worker& worker = *workers_[static_cast<size_t>(t)];
    for (size_t i = 0; i < worker.visit_count; ++i) {
      occupancy.Prefetch(worker.visits[std::min(i + kPrefetchVisits, worker.visit_count - 1)].cell);
      occupancy.Record(worker.visits[i].cell, worker.visits[i].weight);
    }
  }
  const uint64_t done = step + 1;
  if (done >= static_cast<uint64_t>(config_.occupancy_start_step) &&
      done % static_cast<uint64_t>(config_.occupancy_interval_steps) == 0) {
    occupancy.Update();
  }
}

}  // namespace romap::nerf
