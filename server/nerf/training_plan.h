#pragma once

#include <cstdint>

#include "server/nerf/nerf_config.h"

namespace romap {

// How long an object is trained and how fast it learns, as views arrive one by one.
//
// The learning rate falls exponentially over the planned steps. It is a function of the steps that are left, so a view
// that comes after the plan is fulfilled extends the plan and thereby warms the rate up a little. Training far beyond
// the plan would make density drift behind textureless surfaces, hence `max_steps`.
class TrainingPlan {
 public:
  explicit TrainingPlan(const NerfConfig& config) : config_(config) { Restart(); }

  void Restart() { planned_steps_ = static_cast<uint64_t>(config_.full_budget_steps); }
  // A new view came when `steps_done` steps were done.
  void OnNewView(uint64_t steps_done);
  // The pose of a view was corrected; `shift_share` is how far it moved against the box, in sides of the box. Density
  // that a wrong pose put before or behind the surface goes only while the rate is high, so the plan is extended in
  // proportion, up to a whole new training.
  void OnCorrectedView(uint64_t steps_done, double shift_share);

  // The training box was replaced; `unknown_share` of the new one, 0..1, lies outside the old one. The plan is extended
  // in proportion, between a fifth of a new training and the whole.
  void OnNewBox(uint64_t steps_done, double unknown_share);

  // Steps allowed so far. `complete`: no more views are expected, so train to the end of the plan.
  uint64_t AllowedSteps(int views, bool complete) const;
  double LearningRate(uint64_t step) const;

 private:
  NerfConfig config_;
  uint64_t planned_steps_ = 0;
};

}  // namespace romap
