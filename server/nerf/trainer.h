#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "server/nerf/nerf_config.h"
#include "server/nerf/train_stats.h"

namespace romap::nerf {

class Occupancy;
struct FieldModel;
struct StepSource;
struct TrainingState;

// Trains one FieldModel on some back end. Not thread-safe. Between calls the model, the moments of the optimizer and
// the occupancy are in host memory, so that a failing device loses nothing that was learned before.
class Trainer {
 public:
  virtual ~Trainer() = default;

  // Runs `steps` steps. `threads` (1..64): number of CPU threads, including the caller.
  virtual TrainStats Run(const StepSource& source, Occupancy& occupancy, int steps, int threads) = 0;

  // Initializes a new signed-distance field with given distances; see cpu/distance_fit.h.
  virtual void FitDistances(const StepSource& source, std::span<const float> distance) = 0;

  // Multiplies the features by `share`, (0..1], and the weights that read them by 1 / share. The outputs stay the same,
  // because hidden neurons are linear or zero, but a step of Adam changes them more. Without this, large features from
  // the first training keep their errors (loss of plasticity of warm starts: J. Ash, R. Adams, "On Warm-Starting Neural
  // Network Training", 2020). No effect without learned features (frequency encoding).
  virtual void ShrinkFeatures(float share) = 0;

  // Frees the memory that only Run() needs; the next Run() allocates it again.
  virtual void ReleaseScratch() = 0;

  virtual TrainingState& state() = 0;
  virtual const FieldModel& model() const = 0;
  virtual uint64_t steps_done() const = 0;
};

// A new field and its trainer on the back end of `config.backend`; on the CPU if that back end is not available or has
// failed in this process. The choice is logged once. The same seed gives the same new field on every back end.
std::unique_ptr<Trainer> MakeTrainer(const NerfConfig& config, uint64_t seed);

}  // namespace romap::nerf
