#include "server/nerf/training_pool.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <optional>
#include <string>
#include <utility>

#include "common/log_context.h"
#include "common/status.h"
#include "common/thread_priority.h"

namespace romap::nerf {

using Clock = TrainingJob::Clock;

TrainingPool::TrainingPool(const NerfConfig& config, int workers)
    : config_(config), queue_(config, std::max(0, workers)) {
  for (int i = 0; i < workers; ++i) workers_.emplace_back([this] { RunWorker(); });
}

TrainingPool::~TrainingPool() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  work_changed_.notify_all();
  workers_.clear();
}

TrainingPool::SessionId TrainingPool::AddSession(Sink sink, const TrainingOwner& owner) {
  std::lock_guard lock(mutex_);
  return queue_.AddSession(std::move(sink), owner);
}

void TrainingPool::RemoveSession(SessionId session_id) {
  std::unique_ptr<TrainingQueue::Session> removed;  // its fields are freed after the lock is released
  std::unique_lock lock(mutex_);
  if (TrainingQueue::Session* session = queue_.FindSession(session_id)) session->closing = true;
  lease_returned_.wait(lock, [&] {
    const TrainingQueue::Session* session = queue_.FindSession(session_id);
    return session == nullptr || session->leases == 0;
  });
  removed = queue_.ExtractSession(session_id);
  lock.unlock();
}

void TrainingPool::Offer(SessionId session, ObjectViews update) {
  std::lock_guard lock(mutex_);
  queue_.AddUpdate(session, std::move(update));
  work_changed_.notify_one();
}

void TrainingPool::RemoveObject(SessionId session, ObjectId object) {
  std::shared_ptr<TrainingJob> job;  // freed after the lock is released
  std::lock_guard lock(mutex_);
  job = queue_.RemoveObject(session, object);
}

void TrainingPool::Finish(SessionId session_id) {
  std::lock_guard lock(mutex_);
  TrainingQueue::Session* session = queue_.FindSession(session_id);
  if (session == nullptr) return;
  session->finished = true;
  work_changed_.notify_all();
}

TrainingPool::Progress TrainingPool::GetProgress(SessionId session) const {
  std::lock_guard lock(mutex_);
  return queue_.Progress(session);
}

bool TrainingPool::IsIdle(SessionId session) const {
  std::lock_guard lock(mutex_);
  return queue_.IsIdle(session);
}

void TrainingPool::RunWorker() {
  LowerThreadPriority(kTrainingNice);
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    std::optional<TrainingQueue::Lease> lease = queue_.Next(Clock::now());
    if (!lease) {
      if (const auto wake = queue_.NextCompletionTime()) {
        work_changed_.wait_until(lock, *wake);
      } else {
        work_changed_.wait(lock);
      }
      continue;
    }
    RunLease(*lease, lock);
  }
}

void TrainingPool::TrainSlices(SessionId session, int count) {
  std::unique_lock lock(mutex_);
  for (int i = 0; i < count; ++i) {
    std::optional<TrainingQueue::Lease> lease = queue_.Next(Clock::now(), session);
    if (!lease) return;
    RunLease(*lease, lock);
  }
}

// Runs the slice of a lease without the lock, then returns the lease.
void TrainingPool::RunLease(TrainingQueue::Lease& lease, std::unique_lock<std::mutex>& lock) {
  lock.unlock();
  const LogContext context(lease.session->owner.session_id);
  std::string failure;
  double cost_s = 0;
  try {
    cost_s = RunSlice(lease);
  } catch (const std::exception& e) {  // from a library, or out of memory: only this object is lost
    failure = e.what();
  }
  lock.lock();
  if (!failure.empty()) {
    spdlog::error("{}: training failed; object abandoned: {}", lease.job->object.ToString(), failure);
    queue_.Abandon(lease);
  }
  queue_.Return(lease, cost_s);
  work_changed_.notify_one();
  lease_returned_.notify_all();
}

// Returns the CPU time of the training.
double TrainingPool::RunSlice(TrainingQueue::Lease& lease) {
  TrainingJob& job = *lease.job;
  if (!job.field) job.field = std::make_unique<ObjectField>(config_, job.object, job.object.value);
  ObjectField& field = *job.field;
  for (ObjectViews& update : lease.updates) ApplyUpdate(field, std::move(update));
  uint64_t goal = 0;
  TrainStats stats;
  if (queue_.policy().HasTimeLeft(job.busy_s, field.views())) {
    stats = TrainField(field, lease);
    goal = field.AllowedSteps(lease.complete);
  }
  bool budget_used = field.steps() >= goal;
  bool converged = false;
  {
    std::lock_guard lock(mutex_);
    UpdateJob(job, stats);
    converged = job.StepsLeft(/*complete=*/true) == 0;
    budget_used |= converged;  // if the time is used up, there is no later slice that could send the result
    if (job.removed || lease.session->closing || !queue_.policy().ShouldSend(job, budget_used, Clock::now())) {
      if (budget_used) field.ReleaseScratch();
      return stats.BusySeconds();
    }
    job.sent_steps = job.steps;
    job.sent_time = Clock::now();
  }
  FieldSnapshot snapshot = field.Snapshot();
  snapshot.converged = converged;
  if (budget_used) field.ReleaseScratch();
  lease.session->sink(std::move(snapshot));
  return stats.BusySeconds();
}

void TrainingPool::ApplyUpdate(ObjectField& field, ObjectViews update) {
  if (update.S_new_old) field.Move(*update.S_new_old);
  // The field reports the errors in its warning.
  for (const ViewPose& pose : update.corrected_views) field.CorrectView(pose).IgnoreError();
  field.SetBox(update.cuboid).IgnoreError();
  for (ObjectView& view : update.new_views) field.AddView(std::move(view)).IgnoreError();
}

TrainStats TrainingPool::TrainField(ObjectField& field, const TrainingQueue::Lease& lease) const {
  const uint64_t goal = field.AllowedSteps(lease.complete);
  const uint64_t left = goal > field.steps() ? goal - field.steps() : 0;
  const int steps = static_cast<int>(std::min<uint64_t>(left, static_cast<uint64_t>(config_.slice_steps)));
  return steps > 0 ? field.Train(steps, lease.threads) : TrainStats();
}

// Copies the state of the field, after a slice, to the job.
void TrainingPool::UpdateJob(TrainingJob& job, const TrainStats& stats) const {
  const ObjectField& field = *job.field;
  job.busy_s += stats.BusySeconds();
  job.views = field.views();
  job.steps = field.steps();
  const bool has_time_left = queue_.policy().HasTimeLeft(job.busy_s, job.views);
  job.allowed_steps = has_time_left ? field.AllowedSteps(/*complete=*/false) : job.steps;
  job.planned_steps = has_time_left ? field.AllowedSteps(/*complete=*/true) : job.steps;
  job.loss_decrease = field.LossDecrease().value_or(1);
  if (job.steps < job.sent_steps) job.sent_steps = 0;  // training restarted
  std::string warning = field.Warning();
  if (warning != job.warning && !warning.empty()) spdlog::warn("{}: {}", job.object.ToString(), warning);
  job.warning = std::move(warning);
}

}  // namespace romap::nerf
