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

// What optimises one FieldModel, on whichever back end. Not thread-safe. Between calls the model, the optimiser's
// moments and the occupancy are in host memory, so that what a back end has learned outlives its device.
class Trainer {
 public:
  virtual ~Trainer() = default;

  // `steps` more steps; `threads` (1..64) counts the threads of the CPU, the caller being one of them.
  virtual TrainStats Run(const StepSource& source, Occupancy& occupancy, int steps, int threads) = 0;

  // Gives a new field of signed distances a shape to begin with; see cpu/distance_fit.h.
  virtual void FitDistances(const StepSource& source, std::span<const float> distance) = 0;

  // Shrinks the features to `share`, (0..1], of what they are without changing what the field shows, so that it learns
  // something else more readily; see FieldTrainer::Loosen.
  virtual void Loosen(float share) = 0;

  // Gives back the memory that only Run() needs; the next Run() takes it again.
  virtual void ReleaseScratch() = 0;

  virtual const FieldModel& model() const = 0;
  virtual uint64_t steps_done() const = 0;
};

// A new field and its trainer on the back end that `config.backend` asks for. Where that is not there, or has failed in
// this process, on the CPU; the log says once which it is. The same seed gives the same new field on every back end.
std::unique_ptr<Trainer> MakeTrainer(const NerfConfig& config, uint64_t seed);

}  // namespace romap::nerf
