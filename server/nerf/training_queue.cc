#include "server/nerf/training_queue.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace romap::nerf {

TrainingQueue::TrainingQueue(const NerfConfig& config, int workers)
    : policy_(config, /*uses_clock=*/workers > 0), workers_(workers) {}

TrainingSessionId TrainingQueue::AddSession(Sink sink) {
  auto session = std::make_unique<Session>();
  session->sink = std::move(sink);
  sessions_.emplace(next_session_, std::move(session));
  return next_session_++;
}

TrainingQueue::Session* TrainingQueue::FindSession(TrainingSessionId session) {
  const auto found = sessions_.find(session);
  return found != sessions_.end() ? found->second.get() : nullptr;
}

const TrainingQueue::Session* TrainingQueue::FindSession(TrainingSessionId session) const {
  const auto found = sessions_.find(session);
  return found != sessions_.end() ? found->second.get() : nullptr;
}

std::unique_ptr<TrainingQueue::Session> TrainingQueue::ExtractSession(TrainingSessionId session) {
  auto node = sessions_.extract(session);
  return node.empty() ? nullptr : std::move(node.mapped());
}

void TrainingQueue::AddUpdate(TrainingSessionId session_id, ObjectViews update) {
  Session* session = FindSession(session_id);
  if (session == nullptr || session->closing || session->abandoned.contains(update.object)) return;
  std::shared_ptr<TrainingJob>& job = session->jobs[update.object];
  if (!job) {
    job = std::make_shared<TrainingJob>();
    job->object = update.object;
  }
  if (!update.new_views.empty() || !update.corrected_views.empty()) job->last_view_time = TrainingJob::Clock::now();
  job->pending_updates.push_back(std::move(update));
}

std::shared_ptr<TrainingJob> TrainingQueue::RemoveObject(TrainingSessionId session_id, ObjectId object) {
  Session* session = FindSession(session_id);
  if (session == nullptr) return nullptr;
  auto node = session->jobs.extract(object);
  if (node.empty()) return nullptr;
  node.mapped()->removed = true;
  return std::move(node.mapped());
}

std::optional<TrainingQueue::Lease> TrainingQueue::Next(Time now, std::optional<TrainingSessionId> only_session) {
  Session* best_session = nullptr;
  std::shared_ptr<TrainingJob> best;
  auto best_key = std::tuple(0, uint64_t{0}, std::pair(0.0, 0.0));
  int busy = 0;  // leased or runnable jobs
  for (const auto& [id, session] : sessions_) {
    if (session->closing || (only_session && id != *only_session)) continue;
    busy += session->leases;
    for (const auto& [object, job] : session->jobs) {
      if (!policy_.IsRunnable(*job, session->finished, now)) continue;
      ++busy;
      const auto key = std::tuple(session->leases, session->last_turn, policy_.Urgency(*job));
      if (best && !(key < best_key)) continue;
      best_session = session.get();
      best = job;
      best_key = key;
    }
  }
  if (!best) return std::nullopt;
  best->leased = true;
  ++best_session->leases;
  best_session->last_turn = ++turns_;
  // If there are fewer jobs than workers, a job may use the cores of the idle workers.
  const int threads = std::max(1, workers_ / std::max(1, busy));
  return Lease{best_session, best, std::exchange(best->pending_updates, {}),
               policy_.IsComplete(*best, best_session->finished, now), threads};
}

void TrainingQueue::Return(const Lease& lease) {
  lease.job->leased = false;
  --lease.session->leases;
}

void TrainingQueue::Abandon(const Lease& lease) {
  std::erase_if(lease.session->jobs, [&](const auto& entry) { return entry.second == lease.job; });
  lease.session->abandoned.insert(lease.job->object);
}

std::optional<TrainingQueue::Time> TrainingQueue::NextCompletionTime() const {
  std::optional<Time> next;
  for (const auto& [id, session] : sessions_) {
    if (session->closing) continue;
    for (const auto& [object, job] : session->jobs) {
      const std::optional<Time> time = policy_.CompletionTime(*job);
      if (time && (!next || *time < *next)) next = time;
    }
  }
  return next;
}

TrainingProgress TrainingQueue::Progress(TrainingSessionId session_id) const {
  TrainingProgress progress{.progress = 1.0};
  const Session* session = FindSession(session_id);
  if (session == nullptr || session->jobs.empty()) return progress;
  double done = 0;
  for (const auto& [object, job] : session->jobs) {
    ++progress.objects_total;
    progress.steps += job->steps;
    if (job->leased || !job->pending_updates.empty() || job->StepsLeft(/*complete=*/true) > 0) {
      ++progress.objects_training;
    }
    done += policy_.Progress(*job);
  }
  progress.progress = done / progress.objects_total;
  return progress;
}

bool TrainingQueue::IsIdle(TrainingSessionId session_id) const {
  const Session* session = FindSession(session_id);
  if (session == nullptr) return true;
  return std::ranges::all_of(session->jobs,
                             [&](const auto& entry) { return policy_.IsIdle(*entry.second, session->finished); });
}

}  // namespace romap::nerf
