#include "server/nerf/training_plan.h"

#include <algorithm>
#include <cmath>

namespace romap {

void TrainingPlan::OnNewView(uint64_t steps_done) {
  if (steps_done < static_cast<uint64_t>(config_.full_budget_steps)) return;
  const int from = std::max(planned_steps_, static_cast<int>(std::min<uint64_t>(steps_done, config_.max_steps)));
  planned_steps_ = std::min(from + config_.refine_steps_per_view, std::max(config_.max_steps, planned_steps_));
}

uint64_t TrainingPlan::AllowedSteps(int views, bool complete) const {
  if (views == 0) return 0;
  if (complete) return static_cast<uint64_t>(planned_steps_);
  if (views < config_.min_views) return 0;
  const int budget = config_.first_budget_steps + (views - config_.min_views) * config_.budget_steps_per_view;
  // Past the full budget every extension was earned by a view.
  if (budget >= config_.full_budget_steps) return static_cast<uint64_t>(planned_steps_);
  return static_cast<uint64_t>(std::min(budget, planned_steps_));
}

double TrainingPlan::LearningRate(uint64_t step) const {
  const double left = std::max(0.0, static_cast<double>(planned_steps_) - static_cast<double>(step));
  const double share = std::min(1.0, left / config_.full_budget_steps);
  return config_.final_learning_rate * std::pow(config_.learning_rate / config_.final_learning_rate, share);
}

}  // namespace romap
