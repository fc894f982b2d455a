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
  const std::vector<ObjectView>* views = nullptr;  // of one object, all there from the start
  uint64_t seed = 1;
  int threads = 2;
  BenchClock clock = BenchClock::kCpu;
  double limit_s = 0;                // of training; a plan that does not fit is shortened before it begins
  std::vector<double> marks_s = {};  // ascending; a snapshot is taken when training has lasted so long
  std::function<bool()> stop = {};   // asked every quarter second or so; true ends the training
};

struct TimedTraining {
  FieldSnapshot snapshot;               // at the end
  std::vector<FieldSnapshot> at_marks;  // one per mark that was reached
  double train_s = 0;                   // by the clock; with the ray lists and the carving that training begins with
  double wall_s = 0;
  double setup_s = 0;      // of taking the views in, by the clock
  bool limited = false;    // the plan was longer than the limit allowed
  nerf::TrainStats stats;  // sums; color_loss of the last slice
};

// Trains one object from nothing to the end of its plan or to the limit. Where the whole plan does not fit, fewer steps
// are planned, so that the learning rate falls to its end within the limit; how many fit is found by training a copy
// for a moment, or taken from `seconds_per_step` when that is positive. It is set to what was measured.
// CANCELLED: stopped. INVALID_ARGUMENT, FAILED_PRECONDITION: as ObjectField says of box and views.
absl::StatusOr<TimedTraining> TrainWithin(const TrainingRequest& request, double& seconds_per_step);

}  // namespace romap::bench
