#include "server/nerf/training_queue.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace romap::nerf {

TrainingQueue::TrainingQueue(const NerfConfig& config, int workers)
    : policy_(config, /*uses_clock=*/workers > 0), workers_(workers) {}

TrainingSessionId TrainingQueue::AddSession(Sink sink, const TrainingOwner& owner) {
  auto session = std::make_unique<Session>();
  session->sink = std::move(sink);
  session->owner = owner;
  tenants_.try_emplace(owner.tenant);
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
  if (node.empty()) return nullptr;
  const std::string& tenant = node.mapped()->owner.tenant;
  if (std::ranges::none_of(sessions_, [&](const auto& entry) { return entry.second->owner.tenant == tenant; })) {
    tenants_.erase(tenant);
  }
  return std::move(node.mapped());
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

// `runnable`: increased by the number of jobs that could be leased. Null: there is none.
std::shared_ptr<TrainingJob> TrainingQueue::MostUrgentJob(const Session& session, Time now, int* runnable) const {
  std::shared_ptr<TrainingJob> best;
  for (const auto& [object, job] : session.jobs) {
    if (!policy_.IsRunnable(*job, session.finished, now)) continue;
    ++*runnable;
    if (!best || policy_.Urgency(*job) < policy_.Urgency(*best)) best = job;
  }
  return best;
}

void TrainingQueue::UpdateShares(const std::vector<Candidate>& candidates) {
  std::set<std::string> waiting;  // tenants with candidates
  for (const Candidate& candidate : candidates) {
    tenants_.at(candidate.session->owner.tenant)
        .among_sessions.Update(candidate.job != nullptr, &candidate.session->share);
    if (candidate.job) waiting.insert(candidate.session->owner.tenant);
  }
  for (auto& [name, tenant] : tenants_) among_tenants_.Update(waiting.contains(name), &tenant.share);
}

double TrainingQueue::TenantClaim_s(const Session& session) const {
  return FairShare::Claim_s(tenants_.at(session.owner.tenant).share);
}

std::optional<TrainingQueue::Lease> TrainingQueue::Next(Time now, std::optional<TrainingSessionId> only_session) {
  std::vector<Candidate> candidates;
  int busy = 0;  // leased or runnable jobs
  for (const auto& [id, session] : sessions_) {
    if (session->closing || (only_session && id != *only_session)) continue;
    busy += session->leases;
    candidates.push_back({.session = session.get(), .job = MostUrgentJob(*session, now, &busy)});
  }
  UpdateShares(candidates);
  std::erase_if(candidates, [](const Candidate& candidate) { return !candidate.job; });
  if (candidates.empty()) return std::nullopt;
  const Candidate& best = *std::ranges::min_element(candidates, {}, [&](const Candidate& candidate) {
    const Session& session = *candidate.session;
    return std::tuple(TenantClaim_s(session), FairShare::Claim_s(session.share), session.last_turn);
  });
  Session* session = best.session;
  Tenant& tenant = tenants_.at(session->owner.tenant);
  among_tenants_.BeginTurn(&tenant.share);
  tenant.among_sessions.BeginTurn(&session->share);
  best.job->leased = true;
  ++session->leases;
  session->last_turn = ++turns_;
  // If there are fewer jobs than workers, a job may use the cores of the idle workers.
  const int threads = std::max(1, workers_ / std::max(1, busy));
  return Lease{session, best.job, std::exchange(best.job->pending_updates, {}),
               policy_.IsComplete(*best.job, session->finished, now), threads};
}

void TrainingQueue::Return(const Lease& lease, double cost_s) {
  lease.job->leased = false;
  --lease.session->leases;
  FairShare::EndTurn(cost_s, &lease.session->share);
  FairShare::EndTurn(cost_s, &tenants_.at(lease.session->owner.tenant).share);
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
