#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <optional>
#include <string>

#include "common/cuboid.h"
#include "common/field_snapshot.h"
#include "common/stage_messages.h"
#include "server/nerf/boxed_field.h"
#include "server/nerf/field_probe.h"
#include "server/nerf/field_warnings.h"
#include "server/nerf/loss_trend.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/ray_set.h"
#include "server/nerf/train_stats.h"
#include "server/nerf/training_plan.h"
#include "server/nerf/training_views.h"

namespace romap::nerf {

// One object's neural field with its views and its training (paper, section on the NeRF model). Not thread-safe: one
// owner at a time. Snapshots are independent of it.
class ObjectField {
 public:
  // The same seed, inputs and thread counts give the same field.
  ObjectField(const NerfConfig& config, ObjectId id, uint64_t seed);

  // Sets the object's cuboid, before enlargement. A cuboid that still fits the training box changes nothing. Otherwise
  // the learned field is transferred to a new box, and the training plan is extended in proportion to the unknown part
  // of that box. If the boxes overlap too little, training restarts. INVALID_ARGUMENT: see ValidateCuboid.
  absl::Status SetBox(const Cuboid& cuboid);

  // Adds a view, or replaces the view of the same keyframe. FAILED_PRECONDITION: there is no box yet, or the view is of
  // another object. INVALID_ARGUMENT: see ValidateView. RESOURCE_EXHAUSTED: see TrainingViews::Add.
  absl::Status AddView(ObjectView view);

  // Applies a map correction: the space around the object moved by `S_new_old`. Later boxes and views are in the new
  // world. The field, its box and its views move together, so nothing has to be retrained. Ignored if not finite.
  void Move(const Sim3<World, World>& S_new_old);

  // Sets the corrected pose, in the new world, of an existing view; ignored if the view does not exist. The training
  // plan is extended in proportion to the change. See TrainingViews::Correct. INVALID_ARGUMENT: see ValidateView; the
  // view is unchanged.
  absl::Status CorrectView(const ViewPose& pose);

  // Does `steps` optimization steps on `threads` (1..64) threads. No effect without box or views.
  TrainStats Train(int steps, int threads);

  // A copy of the current field. The caller sets `converged`, because it knows whether more training is planned.
  FieldSnapshot Snapshot() const;

  // Human-readable problems with the object's input; empty if there are none. See FieldWarnings.
  std::string Warning() const;

  // Frees the memory that only Train() needs, until the next Train().
  void ReleaseScratch() { field_.ReleaseScratch(); }

  int views() const { return static_cast<int>(views_.size()); }
  uint64_t steps() const { return field_.steps(); }
  // See LossTrend::DecreasePer100Steps.
  std::optional<double> LossDecrease() const { return loss_trend_.DecreasePer100Steps(); }
  // The number of steps that the training plan allows now; see TrainingPlan. 0 while training is paused because it
  // diverged several times on the same views and box.
  uint64_t AllowedSteps(bool complete) const;

 private:
  absl::Status FitBox(const Cuboid& cuboid);
  absl::Status Reject(absl::Status error);
  void OnNewInput();
  void RestartTraining();
  void ResetProgress();
  void RebuildHull();
  void PrepareViews();
  uint64_t StepsUntilEvaluation() const;
  TrainStats RunSteps(int steps, int threads);
  void Evaluate();
  void RefinePoses();
  bool IsPaused() const;

  NerfConfig config_;
  ObjectId id_;
  // Field, box, views and hull stay in the world frame in which the object was created. Input is transformed into that
  // frame, output into the current world frame.
  Sim3<World, World> S_new_first_;
  BoxedField field_;
  TrainingViews views_;
  bool views_changed_ = false;  // since PrepareViews()
  RaySet rays_;
  FieldProbe probe_;
  LossTrend loss_trend_;
  TrainingPlan plan_;
  FieldWarnings warnings_;
  int divergences_ = 0;  // since the last change of views or box
  double train_seconds_ = 0;
  double loss_ = 0;
};

}  // namespace romap::nerf
