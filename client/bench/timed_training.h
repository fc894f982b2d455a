#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "client/bench/stopwatch.h"
#include "common/cuboid.h"
#include "common/field_snapshot.h"
#include "common/stage_messages.h"
#include "common/status.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/train_stats.h"

namespace romap::bench {

struct TrainingRequest {
  nerf::NerfConfig config;
  Cuboid cuboid;
  const std::vector<ObjectView>* views = nullptr;  // of one object
  uint64_t seed = 1;
  int threads = 2;
  BenchClock clock = BenchClock::kCpu;
  double limit_s = 0;                // of the training time; a longer training plan is shortened in advance
  std::vector<double> marks_s = {};  // training times for snapshots, ascending
  std::function<bool()> stop = {};   // polled about every 0.25 s; true ends the training
};

struct TimedTraining {
  FieldSnapshot snapshot;               // at the end
  std::vector<FieldSnapshot> at_marks;  // one per mark that was reached
  double train_s = 0;                   // by the clock, including ray lists and hull carving
  double wall_s = 0;
  double setup_s = 0;      // of adding the views, by the clock
  bool limited = false;    // the training plan exceeded the limit
  nerf::TrainStats stats;  // sums over all slices; color_loss is of the last slice
};

// Trains one object until the end of its training plan or the limit. If the plan does not fit, plans fewer steps, so
// that the learning rate schedule completes within the limit. Estimates the number of steps from `seconds_per_step`, or
// by training a copy briefly if it is not positive; sets it to the measured value. CANCELLED: stopped.
// INVALID_ARGUMENT, FAILED_PRECONDITION: invalid box or views, see ObjectField.
absl::StatusOr<TimedTraining> TrainWithin(const TrainingRequest& request, double& seconds_per_step);

}  // namespace romap::bench
