#pragma once

#include <optional>
#include <utility>

#include "server/nerf/nerf_config.h"
#include "server/nerf/training_job.h"

namespace romap::nerf {

// The scheduling rules of the training pool: pure functions of the configuration, the state of a job and the time.
class TrainingPolicy {
 public:
  using Time = TrainingJob::Clock::time_point;

  // `uses_clock` false: no decision depends on time.
  TrainingPolicy(const NerfConfig& config, bool uses_clock) : config_(config), uses_clock_(uses_clock) {}

  // Whether no more views are expected: the session is finished, or no view has arrived for a while.
  bool IsComplete(const TrainingJob& job, bool session_finished, Time now) const;
  // Whether the job has steps left or updates to apply.
  bool IsRunnable(const TrainingJob& job, bool session_finished, Time now) const;
  // When the job becomes complete if no view arrives until then. nullopt if it is leased or would have no steps left.
  std::optional<Time> CompletionTime(const TrainingJob& job) const;
  // Whether the object cannot be trained further unless new input arrives.
  bool IsIdle(const TrainingJob& job, bool session_finished) const;

  // Sort key; the smallest runs first. Objects that have done less than a full training come first, by their share of
  // the planned steps; then the others, by the decrease of their loss.
  std::pair<double, double> Urgency(const TrainingJob& job) const;

  // Whether the limit on the total cost of an object is not reached.
  bool HasTimeLeft(double busy_s, int views) const;

  // Whether to send a snapshot of the field after a slice. `budget_used`: there will be no other slice for now.
  bool ShouldSend(const TrainingJob& job, bool budget_used, Time now) const;

  // 0..1: steps done / steps planned.
  double Progress(const TrainingJob& job) const;

 private:
  NerfConfig config_;
  bool uses_clock_;
};

}  // namespace romap::nerf
