#pragma once

#include <cstdint>
#include <optional>

#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// The number of training steps of one object and their learning rate, as views arrive one by one.
//
// The learning rate decreases exponentially over the planned steps. It depends on the number of steps left: a view that
// arrives after the end of the plan extends the plan, and thereby increases the rate slightly. Steps beyond the plan
// are added while the loss still decreases: see OnEvaluation.
class TrainingPlan {
 public:
  explicit TrainingPlan(const NerfConfig& config) : config_(config) { Restart(); }

  void Restart();
  // A new view arrived after `steps_done` steps.
  void OnNewView(uint64_t steps_done);
  // The pose of a view was corrected; `shift_share` is how far it moved relative to the box, in sides of the box. Only
  // a high rate removes the density that a wrong pose left before or behind the surface, so the plan is extended in
  // proportion to the shift, up to a full new training.
  void OnCorrectedView(uint64_t steps_done, double shift_share);

  // The training box was replaced; the share `unknown_share`, 0..1, of the new one is outside the old one. The plan is
  // extended in proportion, by between a fifth of a full training and all of it.
  void OnNewBox(uint64_t steps_done, double unknown_share);

  // Called after every evaluation with the relative decrease of the loss per 100 steps. If all planned steps are done
  // and the loss still decreases enough, adds a few steps at the final rate: at most `max_extra_steps` since the last
  // view, correction or box.
  void OnEvaluation(uint64_t steps_done, std::optional<double> loss_decrease);

  // The number of steps allowed now. `complete`: no more views are expected, so all planned steps are allowed.
  uint64_t AllowedSteps(int views, bool complete) const;
  double LearningRate(uint64_t step) const;
  // The progress of a full training at `step`: 0 at the first step, 1 at the end of the plan. Decreases when the plan
  // is extended.
  double Progress(uint64_t step) const;

 private:
  NerfConfig config_;
  uint64_t planned_steps_ = 0;
  uint64_t extra_steps_ = 0;  // of these, those added by OnEvaluation() since the last view, correction or box
};

}  // namespace romap::nerf
