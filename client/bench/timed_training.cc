#include "client/bench/timed_training.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "client/bench/stopwatch.h"
#include "server/nerf/object_field.h"

namespace romap::bench {
namespace {

constexpr double kProbe_s = 0.15;
constexpr double kLongestSlice_s = 0.25;

absl::StatusOr<nerf::ObjectField> MakeField(const TrainingRequest& request, const nerf::NerfConfig& config) {
  if (request.views->empty()) return FailedPrecondition("cannot train an object without views");
  nerf::ObjectField field(config, request.views->front().object, request.seed);
  ROMAP_RETURN_IF_ERROR(field.SetBox(request.cuboid));
  for (const ObjectView& view : *request.views) ROMAP_RETURN_IF_ERROR(field.AddView(view));
  return field;
}

absl::StatusOr<double> ProbeSecondsPerStep(const TrainingRequest& request) {
  ROMAP_ASSIGN_OR_RETURN(nerf::ObjectField field, MakeField(request, request.config));
  field.Train(1, request.threads);  // builds the ray lists
  Stopwatch watch(request.clock, request.threads);
  int steps = 0;
  while (watch.total_s() < kProbe_s && steps < request.config.full_budget_steps) {
    const nerf::TrainStats stats = watch.Time([&] { return field.Train(2, request.threads); });
    if (stats.steps == 0) break;
    steps += stats.steps;
  }
  return steps > 0 ? watch.total_s() / steps : 0.0;
}

int StepsUntil(double target_s, double now_s, double seconds_per_step) {
  const double remaining_s = std::clamp(target_s - now_s, 0.0, kLongestSlice_s);
  return std::max(1, static_cast<int>(remaining_s / std::max(seconds_per_step, 1e-7)));
}

}  // namespace

absl::StatusOr<TimedTraining> TrainWithin(const TrainingRequest& request, double& seconds_per_step) {
  if (seconds_per_step <= 0) {
    ROMAP_ASSIGN_OR_RETURN(seconds_per_step, ProbeSecondsPerStep(request));
  }
  TimedTraining result;
  nerf::NerfConfig config = request.config;
  const double affordable_steps = request.limit_s / std::max(seconds_per_step, 1e-7);
  if (affordable_steps < config.full_budget_steps) {
    config.full_budget_steps = std::max(1, static_cast<int>(affordable_steps));
    result.limited = true;
  }
  Stopwatch setup(request.clock, request.threads), training(request.clock, request.threads);
  ROMAP_ASSIGN_OR_RETURN(nerf::ObjectField field, setup.Time([&] { return MakeField(request, config); }));
  const auto marked = [&] { return result.at_marks.size() < request.marks_s.size(); };
  while (field.steps() < field.AllowedSteps(/*complete=*/true) && training.total_s() < request.limit_s) {
    if (request.stop && request.stop()) return absl::CancelledError("interrupted");
    const double target_s =
        marked() ? std::min(request.limit_s, request.marks_s[result.at_marks.size()]) : request.limit_s;
    const uint64_t remaining = field.AllowedSteps(true) - field.steps();
    const int steps = StepsUntil(target_s, training.total_s(), seconds_per_step);
    const int slice = static_cast<int>(std::min<uint64_t>(remaining, static_cast<uint64_t>(steps)));
    const nerf::TrainStats stats = training.Time([&] { return field.Train(slice, request.threads); });
    if (stats.steps == 0) break;  // no pixels to train on
    result.stats.Append(stats);
    while (marked() && training.total_s() >= request.marks_s[result.at_marks.size()]) {
      result.at_marks.push_back(field.Snapshot());
    }
  }
  result.limited |= field.steps() < field.AllowedSteps(true) && training.total_s() >= request.limit_s;
  if (result.stats.steps > 0) seconds_per_step = training.total_s() / result.stats.steps;
  result.snapshot = field.Snapshot();
  result.train_s = training.total_s();
  result.wall_s = training.wall_s();
  result.setup_s = setup.total_s();
  return result;
}

}  // namespace romap::bench
