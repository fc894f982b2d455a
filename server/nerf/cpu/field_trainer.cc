#include "server/nerf/cpu/field_trainer.h"

#include <time.h>

#include <algorithm>
#include <barrier>
#include <chrono>
#include <cmath>
#include <cstring>
#include <thread>
#include <utility>

#include "server/nerf/math/composite.h"

namespace romap::nerf {
namespace {

constexpr int kChunkSamples = 1024;  // activations of a chunk stay in the second-level cache

double ThreadCpuSeconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

LossWeights MakeLossWeights(const NerfConfig& config) {
  LossWeights w;
  w.opacity_object = static_cast<float>(config.opacity_weight_object);
  w.opacity_background = static_cast<float>(config.opacity_weight_background);
  w.density = static_cast<float>(config.density_weight);
  w.depth = static_cast<float>(config.depth_weight);
  w.depth_limit = static_cast<float>(config.depth_limit);
  w.random_background = config.random_background;
  return w;
}

}  // namespace

// One thread's buffers.
struct FieldTrainer::Worker {
  Worker(const NerfConfig& config, const FieldModel& model)
      : chunk_rays(kChunkSamples / config.max_samples_per_ray),
        chunk(kChunkSamples, model.layout.features, model.mlp.hidden),
        rays(static_cast<size_t>(chunk_rays)),
        spans(static_cast<size_t>(chunk_rays)),
        table_gradient(model.table.size() + kMaxLanes),
        mlp_gradient(model.mlp.parameters.size()) {
    visits.reserve(static_cast<size_t>(config.rays_per_step * config.max_samples_per_ray));
  }

  // Books the time since the last call to `phase`.
  void Book(TrainPhase phase) {
    const double now = ThreadCpuSeconds();
    stats.phase_cpu_s[static_cast<size_t>(phase)] += now - booked_until_s;
    booked_until_s = now;
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
  std::vector<Visit> visits;  // of one step, for the occupancy
  AlignedBuffer<float> table_gradient, mlp_gradient;
  double booked_until_s = 0;
  uint64_t object_rays = 0;
  TrainStats stats;
};

struct FieldTrainer::StepShare {
  std::barrier<> barrier;
  int threads;
};

FieldTrainer::FieldTrainer(const NerfConfig& config, uint64_t seed, const KernelTable& kernels)
    : config_(config),
      loss_weights_(MakeLossWeights(config)),
      kernels_(&kernels),
      model_(config, seed),
      table_first_(model_.table.size()),
      table_second_(model_.table.size()),
      mlp_first_(model_.mlp.parameters.size()),
      mlp_second_(model_.mlp.parameters.size()) {}

FieldTrainer::~FieldTrainer() = default;
FieldTrainer::FieldTrainer(FieldTrainer&&) noexcept = default;
FieldTrainer& FieldTrainer::operator=(FieldTrainer&&) noexcept = default;

void FieldTrainer::Loosen(float share) {
  for (size_t i = 0; i < model_.table.size(); ++i) model_.table[i] *= share;
  for (size_t i = static_cast<size_t>(model_.mlp.inputs * model_.mlp.hidden); i < model_.mlp.parameters.size(); ++i) {
    model_.mlp.parameters[i] /= share;
  }
  model_.mlp.UpdateTransposed();
}

void FieldTrainer::ReleaseScratch() { workers_.clear(); }

TrainStats FieldTrainer::Run(const StepSource& source, Occupancy& occupancy, int steps, int threads) {
  const auto start = std::chrono::steady_clock::now();
  while (static_cast<int>(workers_.size()) < threads) workers_.push_back(std::make_unique<Worker>(config_, model_));
  StepShare share{std::barrier<>(threads), threads};
  for (int t = 0; t < threads; ++t) {
    workers_[static_cast<size_t>(t)]->stats = {};
    workers_[static_cast<size_t>(t)]->object_rays = 0;
  }
  {
    std::vector<std::jthread> helpers;
    for (int t = 1; t < threads; ++t) {
      helpers.emplace_back([&, t] { RunSteps(source, occupancy, steps, t, share); });
    }
    RunSteps(source, occupancy, steps, 0, share);
  }
  steps_done_ += static_cast<uint64_t>(steps);
  TrainStats total;
  uint64_t object_rays = 0;
  for (int t = 0; t < threads; ++t) {
    const Worker& worker = *workers_[static_cast<size_t>(t)];
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

void FieldTrainer::RunSteps(const StepSource& source, Occupancy& occupancy, int steps, int thread, StepShare& share) {
  Worker& worker = *workers_[static_cast<size_t>(thread)];
  worker.booked_until_s = ThreadCpuSeconds();
  for (int i = 0; i < steps; ++i) {
    const uint64_t step = steps_done_ + static_cast<uint64_t>(i);
    worker.visits.clear();
    const int chunks = (config_.rays_per_step + worker.chunk_rays - 1) / worker.chunk_rays;
    for (int chunk = thread; chunk < chunks; chunk += share.threads) {
      RenderChunk(source, occupancy, step, chunk * worker.chunk_rays, worker);
    }
    share.barrier.arrive_and_wait();
    Optimise(source, occupancy, step, thread, share.threads);
    share.barrier.arrive_and_wait();
    worker.Book(TrainPhase::kOptimise);
  }
}

void FieldTrainer::RenderChunk(const StepSource& source, const Occupancy& occupancy, uint64_t step, int first_ray,
                               Worker& worker) {
  SampleChunk& chunk = worker.chunk;
  worker.ray_count = std::min(worker.chunk_rays, config_.rays_per_step - first_ray);
  for (int r = 0; r < worker.ray_count; ++r) worker.rays[static_cast<size_t>(r)] = source.ray(step, first_ray + r);
  const SamplingRule rule{.occupied_bits = occupancy.bits(),
                          .extent = source.extent,
                          .finest_step = static_cast<float>(config_.finest_sample_step),
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
  CompositeRays(worker);
  const int active = CompactActive(worker);
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
  for (int r = 0; r < worker.ray_count; ++r) {
    const RaySpan span = worker.spans[static_cast<size_t>(r)];
    if (span.count == 0) continue;
    const RayTarget& target = worker.rays[static_cast<size_t>(r)].target;
    const int at = span.first;
    const RaySamples samples{
        span.count,          c.t.data() + at,       c.length.data() + at,
        c.alpha.data() + at, c.density.data() + at, {c.red.data() + at, c.green.data() + at, c.blue.data() + at}};
    float* weight = c.weight.data() + at;
    float* behind = c.behind.data() + at;
    const RayResult result = plain::CompositeForward(samples, target, loss_weights_, weight, behind);
    plain::CompositeBackward(samples, target, loss_weights_, result, weight, behind, c.d_raw.data() + kOutputs * at);
    for (int i = 0; i < span.count; ++i) worker.visits.push_back({c.cell[static_cast<size_t>(at + i)], weight[i]});
    ++worker.stats.rays;
    if (target.is_object) {
      worker.stats.color_loss += result.color_loss;
      ++worker.object_rays;
    }
  }
}

// Moves the samples whose gradient matters to the front, scaled to the mean over rays. About half of them remain: the
// others lie in empty space or behind the surface.
int FieldTrainer::CompactActive(Worker& worker) {
  SampleChunk& c = worker.chunk;
  const float cut = static_cast<float>(config_.gradient_cut);
  const float scale = 1.0f / static_cast<float>(config_.rays_per_step);
  const size_t features = static_cast<size_t>(model_.layout.features), hidden = static_cast<size_t>(model_.mlp.hidden);
  size_t active = 0;
  for (size_t i = 0; i < static_cast<size_t>(c.size); ++i) {
    const float* d = c.d_raw.data() + kOutputs * i;
    if (std::fabs(d[0]) + std::fabs(d[1]) + std::fabs(d[2]) + std::fabs(d[3]) <= cut) continue;
    for (int o = 0; o < kOutputs; ++o) c.d_raw[kOutputs * active + o] = d[o] * scale;
    if (active != i) {
      c.x[active] = c.x[i];
      c.y[active] = c.y[i];
      c.z[active] = c.z[i];
      std::memcpy(c.features.data() + features * active, c.features.data() + features * i, features * sizeof(float));
      std::memcpy(c.hidden.data() + hidden * active, c.hidden.data() + hidden * i, hidden * sizeof(float));
    }
    ++active;
  }
  return static_cast<int>(active);
}

void FieldTrainer::Optimise(const StepSource& source, Occupancy& occupancy, uint64_t step, int thread, int threads) {
  constexpr int kMostThreads = 64;
  float* gradients[kMostThreads];
  const AdamRates rates{source.learning_rate(step), static_cast<float>(config_.adam_beta1),
                        static_cast<float>(config_.adam_beta2)};
  for (int t = 0; t < threads; ++t) gradients[t] = workers_[static_cast<size_t>(t)]->table_gradient.data();
  const auto border = [&](int t) {
    const size_t all = model_.table.size();
    return t == threads ? all : all * static_cast<size_t>(t) / static_cast<size_t>(threads) / kMaxLanes * kMaxLanes;
  };
  kernels_->adam(rates, border(thread), border(thread + 1), model_.table.data(), table_first_.data(),
                 table_second_.data(), gradients, threads);
  if (thread != 0) return;
  for (int t = 0; t < threads; ++t) gradients[t] = workers_[static_cast<size_t>(t)]->mlp_gradient.data();
  kernels_->adam(rates, 0, model_.mlp.parameters.size(), model_.mlp.parameters.data(), mlp_first_.data(),
                 mlp_second_.data(), gradients, threads);
  model_.mlp.UpdateTransposed();
  for (int t = 0; t < threads; ++t) {
    for (const auto& visit : workers_[static_cast<size_t>(t)]->visits) occupancy.Record(visit.cell, visit.weight);
  }
  const uint64_t done = step + 1;
  if (done >= static_cast<uint64_t>(config_.occupancy_start_step) &&
      done % static_cast<uint64_t>(config_.occupancy_interval_steps) == 0) {
    occupancy.Update();
  }
}

}  // namespace romap::nerf
