#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "server/nerf/cpu/kernels.h"
#include "server/nerf/cpu/step_tasks.h"
#include "server/nerf/model/occupancy.h"
#include "server/nerf/model/step_parameters.h"
#include "server/nerf/model/step_source.h"
#include "server/nerf/model/training_state.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/train_stats.h"
#include "server/nerf/trainer.h"

namespace romap::nerf {

// Trains a field on the CPU by stochastic gradient descent on rays: renders chunks of rays, accumulates gradients per
// share of the rays, then makes one Adam step. Gradients of the shares are added in a fixed order, so the result
// depends on the number of threads, but not on timing.
class CpuTrainer : public Trainer {
 public:
  CpuTrainer(const NerfConfig& config, uint64_t seed, const KernelTable& kernels = SimdKernels());
  ~CpuTrainer() override;
  CpuTrainer(CpuTrainer&&) noexcept;
  CpuTrainer& operator=(CpuTrainer&&) noexcept;

  static constexpr int kMaxThreads = 64;

  // Runs `steps` steps on `threads` (1..kMaxThreads) threads, one of which is the caller. A step allocates nothing.
  TrainStats Run(const StepSource& source, Occupancy& occupancy, int steps, int threads) override;
  void FitDistances(const StepSource& source, std::span<const float> distance) override;
  void ShrinkFeatures(float share) override;
  void ReleaseScratch() override;

  TrainingState& state() override { return state_; }
  const FieldModel& model() const override { return state_.model; }
  uint64_t steps_done() const override { return state_.steps_done; }

 private:
  struct Worker;

  void RunTasks(const StepSource& source, Occupancy& occupancy, int thread, int shares, StepTasks& tasks);
  TrainStats CollectStats(int threads, int steps);
  float SharpnessAt(float progress) const;
  void RenderShare(const StepSource& source, const Occupancy& occupancy, uint64_t round, int share, int shares);
  void RenderChunk(const StepSource& source, const Occupancy& occupancy, uint64_t step, int first_ray, Worker& worker);
  void CompositeRays(Worker& worker);
  void RenderDistances(const StepSource& source, uint64_t step, int first_ray, Worker& worker);
  void Optimize(const StepSource& source, Occupancy& occupancy, uint64_t step, uint64_t task, int shares);
  void UpdateOccupancy(Occupancy& occupancy, uint64_t step, int shares);

  NerfConfig config_;
  LossWeights loss_weights_;
  SampleBudget budget_;
  OccupancyPlan occupancy_plan_;
  TrainingState state_;
  const KernelTable* kernels_;
  std::vector<std::unique_ptr<Worker>> workers_;
};

}  // namespace romap::nerf
