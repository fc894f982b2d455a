#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "server/nerf/cpu/field_model.h"
#include "server/nerf/cpu/kernels.h"
#include "server/nerf/cpu/occupancy.h"
#include "server/nerf/cpu/step_tasks.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/train_stats.h"
#include "server/nerf/trainer.h"

namespace romap::nerf {

// What a step trains on. `ray` must be thread-safe and depend on its arguments only.
struct StepSource {
  std::function<Ray(uint64_t step, int index)> ray;
  std::function<float(uint64_t step)> learning_rate;
  std::function<float(uint64_t step)> progress = {};  // 0..1 of the plan; signed-distance fields alone need it
  std::array<float, 3> extent = {1, 1, 1};            // of the box in Unit space
  GridPose grid = {};
};

LossWeights MakeLossWeights(const NerfConfig& config);

// Optimises a FieldModel by stochastic gradient descent on rays: render chunks of rays, collect gradients per thread,
// one Adam step. The work is divided by ray index and gradients are added in thread order, so the result depends on the
// number of threads, but never on timing.
class FieldTrainer : public Trainer {
 public:
  FieldTrainer(const NerfConfig& config, uint64_t seed, const KernelTable& kernels = SimdKernels());
  ~FieldTrainer() override;
  FieldTrainer(FieldTrainer&&) noexcept;
  FieldTrainer& operator=(FieldTrainer&&) noexcept;

  static constexpr int kMostThreads = 64;

  // `steps` more steps on `threads` (1..kMostThreads) threads (the caller is one of them). Nothing is allocated within
  // a step.
  TrainStats Run(const StepSource& source, Occupancy& occupancy, int steps, int threads) override;

  void FitDistances(const StepSource& source, std::span<const float> distance) override;

  // Makes a trained field ready to learn something else without changing what it shows: features shrink to `share`
  // (0..1] of what they are, and the weights that read them out grow to 1 / share. Hidden neurons are linear or zero,
  // so the outputs stay, but a step of Adam changes them so much more. Without this, features that grew large in the
  // first training hold on to their errors (the loss of plasticity of warm starts: J. Ash, R. Adams, "On Warm-Starting
  // Neural Network Training", 2020). Without learned features (frequency encoding) nothing happens.
  void Loosen(float share) override;

  // Gives back the memory that only Run() needs; the next Run() takes it again.
  void ReleaseScratch() override;

  const FieldModel& model() const override { return model_; }
  uint64_t steps_done() const override { return steps_done_; }

  // What training changes, for a back end that keeps it elsewhere meanwhile. Moments are laid out as their parameters.
  struct State {
    FieldModel& model;
    AlignedBuffer<float>&table_first, &table_second, &mlp_first, &mlp_second;
    uint64_t& steps_done;
  };
  State state() { return {model_, table_first_, table_second_, mlp_first_, mlp_second_, steps_done_}; }

 private:
  struct Worker;

  void RunTasks(const StepSource& source, Occupancy& occupancy, int thread, int shares, StepTasks& tasks);
  float SharpnessAt(float progress) const;
  void RenderShare(const StepSource& source, const Occupancy& occupancy, uint64_t round, int share, int shares);
  void RenderChunk(const StepSource& source, const Occupancy& occupancy, uint64_t step, int first_ray, Worker& worker);
  void CompositeRays(Worker& worker);
  void RenderDistances(const StepSource& source, uint64_t step, int first_ray, Worker& worker);
  void Optimise(const StepSource& source, Occupancy& occupancy, uint64_t step, uint64_t task, int shares);
  void UpdateOccupancy(Occupancy& occupancy, uint64_t step, int shares);

  NerfConfig config_;
  LossWeights loss_weights_;
  FieldModel model_;
  const KernelTable* kernels_;
  AlignedBuffer<float> table_first_, table_second_, mlp_first_, mlp_second_;  // Adam's moments
  std::vector<std::unique_ptr<Worker>> workers_;
  uint64_t steps_done_ = 0;
};

}  // namespace romap::nerf
