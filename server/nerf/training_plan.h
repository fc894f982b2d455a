#pragma once

#include <cstdint>
#include <optional>

#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// How long an object is trained and how fast it learns, as views arrive one by one.
//
// The learning rate falls exponentially over the planned steps. It is a function of the steps that are left, so a view
// that comes after the plan is fulfilled extends the plan and thereby warms the rate up a little. What comes beyond the
// plan is earned by the loss, step by step: see OnFulfilled.
class TrainingPlan {
 public:
  explicit TrainingPlan(const NerfConfig& config) : config_(config) { Restart(); }

  void Restart();
  // A new view came when `steps_done` steps were done.
  void OnNewView(uint64_t steps_done);
  // The pose of a view was corrected; `shift_share` is how far it moved against the box, in sides of the box. Density
  // that a wrong pose put before or behind the surface goes only while the rate is high, so the plan is extended in
  // proportion, up to a whole new training.
  void OnCorrectedView(uint64_t steps_done, double shift_share);

  // The training box was replaced; `unknown_share` of the new one, 0..1, lies outside the old one. The plan is extended
  // in proportion, between a fifth of a new training and the whole.
  void OnNewBox(uint64_t steps_done, double unknown_share);

  // The plan is fulfilled, and the loss of `loss_fall`, a share, in 100 steps: as long as that is worth it, a few steps
  // at the final rate are added, up to `max_extra_steps` since the last view, correction or box.
  void OnFulfilled(uint64_t steps_done, std::optional<double> loss_fall);

  // Steps allowed so far. `complete`: no more views are expected, so train to the end of the plan.
  uint64_t AllowedSteps(int views, bool complete) const;
  double LearningRate(uint64_t step) const;
  // How far a full training is at `step`: 0 at its first, 1 at the end of the plan. What extends the plan sets it back
  // a little.
  double Progress(uint64_t step) const;

 private:
  NerfConfig config_;
  uint64_t planned_steps_ = 0;
  uint64_t extra_steps_ = 0;  // of these, those that the falling loss has earned since something was new
};

}  // namespace romap::nerf
