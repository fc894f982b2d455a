#include "server/nerf/training_policy.h"

#include <algorithm>
#include <chrono>

namespace romap::nerf {

bool TrainingPolicy::IsComplete(const TrainingJob& job, bool session_finished, Time now) const {
  if (session_finished) return true;
  if (!uses_clock_) return false;
  const std::chrono::duration<double> since_last_view = now - job.last_view_time;
  return since_last_view.count() >= config_.completion_delay_s && job.views >= config_.min_views;
}

bool TrainingPolicy::IsRunnable(const TrainingJob& job, bool session_finished, Time now) const {
  if (job.leased) return false;
  return !job.pending_updates.empty() || job.StepsLeft(IsComplete(job, session_finished, now)) > 0;
}

std::optional<TrainingPolicy::Time> TrainingPolicy::CompletionTime(const TrainingJob& job) const {
  if (job.leased || job.views < config_.min_views || job.StepsLeft(/*complete=*/true) == 0) return std::nullopt;
  return job.last_view_time + std::chrono::duration_cast<TrainingJob::Clock::duration>(
                                  std::chrono::duration<double>(config_.completion_delay_s));
}

bool TrainingPolicy::IsIdle(const TrainingJob& job, bool session_finished) const {
  const bool trainable = session_finished || job.views >= config_.min_views;
  return !job.leased && job.pending_updates.empty() && (!trainable || job.StepsLeft(/*complete=*/true) == 0);
}

std::pair<double, double> TrainingPolicy::Urgency(const TrainingJob& job) const {
  if (job.steps >= static_cast<uint64_t>(config_.full_budget_steps)) return {1.0, -job.loss_decrease};
  return {static_cast<double>(job.steps) / static_cast<double>(std::max<uint64_t>(1, job.planned_steps)), 0.0};
}

bool TrainingPolicy::HasTimeLeft(double busy_s, int views) const {
  return !uses_clock_ || busy_s < config_.max_training_time_s + config_.max_training_time_per_view_s * views;
}

bool TrainingPolicy::ShouldSend(const TrainingJob& job, bool budget_used, Time now) const {
  if (job.steps == 0 || job.steps == job.sent_steps) return false;
  if (budget_used) return true;
  if (job.steps >= job.sent_steps + static_cast<uint64_t>(config_.snapshot_interval_steps)) return true;
  const std::chrono::duration<double> since_last = now - job.sent_time;
  return uses_clock_ && since_last.count() >= config_.snapshot_interval_s;
}

double TrainingPolicy::Progress(const TrainingJob& job) const {
  if (job.steps > 0 && job.StepsLeft(/*complete=*/true) == 0) return 1;
  const double planned = static_cast<double>(std::max<uint64_t>(job.planned_steps, config_.full_budget_steps));
  return std::min(1.0, static_cast<double>(job.steps) / planned);
}

}  // namespace romap::nerf
