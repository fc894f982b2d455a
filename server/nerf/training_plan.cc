#include "server/nerf/training_plan.h"

#include <algorithm>
#include <cmath>

namespace romap::nerf {
namespace {

constexpr double kMinShareForNewBox = 0.2;  // of a full training

}  // namespace

void TrainingPlan::Restart() {
  planned_steps_ = static_cast<uint64_t>(config_.full_budget_steps);
  extra_steps_ = 0;
}

void TrainingPlan::OnEvaluation(uint64_t steps_done, std::optional<double> loss_decrease) {
  constexpr uint64_t kStepsPerExtension = 50;
  if (steps_done < planned_steps_ || loss_decrease.value_or(0) < config_.min_loss_decrease) return;
  const uint64_t max_extra = static_cast<uint64_t>(config_.max_extra_steps);
  const uint64_t extension = std::min(kStepsPerExtension, max_extra - std::min(max_extra, extra_steps_));
  planned_steps_ += extension;
  extra_steps_ += extension;
}

void TrainingPlan::OnNewView(uint64_t steps_done) {
  extra_steps_ = 0;
  const uint64_t full = static_cast<uint64_t>(config_.full_budget_steps);
  if (steps_done < full) return;  // the remaining steps suffice
  const uint64_t extended = std::max(planned_steps_, steps_done) + static_cast<uint64_t>(config_.refine_steps_per_view);
  planned_steps_ = std::min(extended, steps_done + static_cast<uint64_t>(config_.max_refine_steps));
}

void TrainingPlan::OnCorrectedView(uint64_t steps_done, double shift_share) {
  extra_steps_ = 0;
  constexpr double kShiftOfOneView = 0.004;  // counts as much as a new view
  const double weight = std::clamp(shift_share / kShiftOfOneView, 1.0, 100.0);
  const uint64_t extended = planned_steps_ + static_cast<uint64_t>(weight * config_.refine_steps_per_view);
  const uint64_t limit = steps_done + static_cast<uint64_t>(config_.full_budget_steps);
  planned_steps_ = std::max(planned_steps_, std::min(extended, limit));
}

void TrainingPlan::OnNewBox(uint64_t steps_done, double unknown_share) {
  extra_steps_ = 0;
  const double share = std::clamp(2 * unknown_share, kMinShareForNewBox, 1.0);
  const uint64_t wanted = steps_done + static_cast<uint64_t>(share * config_.full_budget_steps);
  planned_steps_ = std::max(planned_steps_, wanted);
}

uint64_t TrainingPlan::AllowedSteps(int views, bool complete) const {
  if (views == 0) return 0;
  if (complete) return planned_steps_;
  if (views < config_.min_views) return 0;
  const int budget = config_.first_budget_steps + (views - config_.min_views) * config_.budget_steps_per_view;
  // The views limit only the first training. Steps beyond it are extensions.
  if (budget >= config_.full_budget_steps) return planned_steps_;
  return std::min(static_cast<uint64_t>(budget), planned_steps_);
}

double TrainingPlan::LearningRate(uint64_t step) const {
  return config_.final_learning_rate *
         std::pow(config_.learning_rate / config_.final_learning_rate, 1 - Progress(step));
}

double TrainingPlan::Progress(uint64_t step) const {
  const double left = std::max(0.0, static_cast<double>(planned_steps_) - static_cast<double>(step));
  return 1 - std::min(1.0, left / config_.full_budget_steps);
}

}  // namespace romap::nerf
