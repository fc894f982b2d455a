#include "server/nerf/training_pool.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <set>
#include <tuple>
#include <utility>

#include "common/status.h"
#include "common/thread_priority.h"

namespace romap::nerf {

// One object of one client. The field belongs to whoever holds the lease, the rest to the mutex.
struct TrainingPool::Job {
  ObjectId id;
  std::unique_ptr<ObjectField> field;  // made by the first lease
  bool leased = false;
  bool removed = false;
  std::vector<ObjectViews> offers;  // not yet given to the field
  Clock::time_point last_view_time = Clock::now();
  // Of the field, after the last slice.
  int views = 0;
  uint64_t steps = 0;
  uint64_t allowed_steps = 0;   // if more views are to come
  uint64_t complete_steps = 0;  // if not
  double loss_fall = 1;         // share of the loss that 100 steps take away; 1 while nobody knows
  double busy_s = 0;            // of all workers, see TrainStats::BusySeconds
  std::string concern;
  // Of the last snapshot.
  uint64_t sent_steps = 0;
  Clock::time_point sent_time = Clock::now();

  uint64_t StepsLeft(bool complete) const {
    const uint64_t goal = complete ? complete_steps : allowed_steps;
    return goal > steps ? goal - steps : 0;
  }

  // Who comes first is less: objects that are far from a full training, then those that gain most from a step.
  std::pair<double, double> Urgency(int full_steps) const {
    const double share = static_cast<double>(steps) / static_cast<double>(std::max<uint64_t>(1, complete_steps));
    return steps < static_cast<uint64_t>(full_steps) ? std::pair(share, 0.0) : std::pair(1.0, -loss_fall);
  }
};

struct TrainingPool::Client {
  Sink sink;
  std::map<ObjectId, std::shared_ptr<Job>> jobs;
  std::set<ObjectId> given_up;  // a second start would lack the views and corrections of the first
  bool finished = false;
  bool closing = false;
  int leases = 0;
  uint64_t last_turn = 0;
};

// The right to train one object for a slice.
struct TrainingPool::Lease {
  Client* client;  // stays while client->leases > 0
  std::shared_ptr<Job> job;
  std::vector<ObjectViews> offers;
  bool complete = false;
  int threads = 1;
};

TrainingPool::TrainingPool(const NerfConfig& config, int threads) : config_(config), threads_(std::max(0, threads)) {
  for (int i = 0; i < threads_; ++i) workers_.emplace_back([this] { Work(); });
}

TrainingPool::~TrainingPool() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  work_changed_.notify_all();
  workers_.clear();
}

uint64_t TrainingPool::Register(Sink sink) {
  std::lock_guard lock(mutex_);
  auto client = std::make_unique<Client>();
  client->sink = std::move(sink);
  clients_.emplace(next_client_, std::move(client));
  return next_client_++;
}

void TrainingPool::Offer(uint64_t client_id, ObjectViews views) {
  std::lock_guard lock(mutex_);
  const auto client = clients_.find(client_id);
  if (client == clients_.end() || client->second->closing) return;
  if (client->second->given_up.contains(views.object)) return;
  std::shared_ptr<Job>& job = client->second->jobs[views.object];
  if (!job) {
    job = std::make_shared<Job>();
    job->id = views.object;
  }
  if (!views.new_views.empty() || !views.corrected_views.empty()) job->last_view_time = Clock::now();
  job->offers.push_back(std::move(views));
  work_changed_.notify_one();
}

void TrainingPool::Remove(uint64_t client_id, ObjectId object) {
  std::shared_ptr<Job> job;  // freed after the lock is given back
  std::lock_guard lock(mutex_);
  const auto client = clients_.find(client_id);
  if (client == clients_.end()) return;
  const auto found = client->second->jobs.find(object);
  if (found == client->second->jobs.end()) return;
  job = std::move(found->second);
  job->removed = true;
  client->second->jobs.erase(found);
}

void TrainingPool::Finish(uint64_t client_id) {
  std::lock_guard lock(mutex_);
  const auto client = clients_.find(client_id);
  if (client == clients_.end()) return;
  client->second->finished = true;
  work_changed_.notify_all();
}

TrainingPool::Progress TrainingPool::GetProgress(uint64_t client_id) const {
  std::lock_guard lock(mutex_);
  Progress progress{.progress = 1.0};
  const auto client = clients_.find(client_id);
  if (client == clients_.end() || client->second->jobs.empty()) return progress;
  double done = 0;
  for (const auto& [id, job] : client->second->jobs) {
    ++progress.objects_total;
    progress.steps += job->steps;
    if (job->leased || !job->offers.empty() || job->StepsLeft(true) > 0) ++progress.objects_training;
    const double planned = static_cast<double>(std::max<uint64_t>(job->complete_steps, config_.full_budget_steps));
    const bool finished = job->steps > 0 && job->StepsLeft(true) == 0;
    done += finished ? 1.0 : std::min(1.0, static_cast<double>(job->steps) / planned);
    if (!job->concern.empty()) progress.concerns.emplace_back(id, job->concern);
  }
  progress.progress = done / progress.objects_total;
  return progress;
}

bool TrainingPool::Idle(uint64_t client_id) const {
  std::lock_guard lock(mutex_);
  const auto client = clients_.find(client_id);
  if (client == clients_.end()) return true;
  return std::ranges::all_of(client->second->jobs, [&](const auto& entry) {
    const Job& job = *entry.second;
    const bool trainable = client->second->finished || job.views >= config_.min_views;
    return !job.leased && job.offers.empty() && (!trainable || job.StepsLeft(true) == 0);
  });
}

void TrainingPool::Unregister(uint64_t client_id) {
  std::unique_ptr<Client> gone;  // its fields are freed after the lock is given back
  std::unique_lock lock(mutex_);
  const auto client = clients_.find(client_id);
  if (client == clients_.end()) return;
  client->second->closing = true;
  Client* waiting = client->second.get();
  lease_returned_.wait(lock, [&] { return waiting->leases == 0; });
  const auto found = clients_.find(client_id);
  if (found == clients_.end()) return;  // another thread unregistered it meanwhile
  gone = std::move(found->second);
  clients_.erase(found);
  lock.unlock();
}

bool TrainingPool::Complete(const Client& client, const Job& job, Clock::time_point now) const {
  if (client.finished) return true;
  if (threads_ == 0) return false;  // time does not count
  const std::chrono::duration<double> quiet = now - job.last_view_time;
  return quiet.count() >= config_.completion_delay_s && job.views >= config_.min_views;
}

bool TrainingPool::Runnable(const Client& client, const Job& job, Clock::time_point now) const {
  return !job.leased && (!job.offers.empty() || job.StepsLeft(Complete(client, job, now)) > 0);
}

// When the next object will count as complete just because time passed.
std::optional<TrainingPool::Clock::time_point> TrainingPool::NextSettleTime() const {
  std::optional<Clock::time_point> next;
  const auto settle =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(config_.completion_delay_s));
  for (const auto& [id, client] : clients_) {
    for (const auto& [object, job] : client->jobs) {
      if (job->leased || client->closing || job->views < config_.min_views || job->StepsLeft(true) == 0) continue;
      const Clock::time_point at = job->last_view_time + settle;
      if (!next || at < *next) next = at;
    }
  }
  return next;
}

// Takes the neediest object of the client whose turn it is.
std::optional<TrainingPool::Lease> TrainingPool::Next(Clock::time_point now, std::optional<uint64_t> only_client) {
  Client* best_client = nullptr;
  std::shared_ptr<Job> best;
  auto best_key = std::tuple(0, uint64_t{0}, std::pair(0.0, 0.0));
  int busy = 0;
  for (const auto& [id, client] : clients_) {
    if (client->closing || (only_client && id != *only_client)) continue;
    busy += client->leases;
    for (const auto& [object, job] : client->jobs) {
      if (!Runnable(*client, *job, now)) continue;
      ++busy;
      const auto key = std::tuple(client->leases, client->last_turn, job->Urgency(config_.full_budget_steps));
      if (best && !(key < best_key)) continue;
      best_client = client.get();
      best = job;
      best_key = key;
    }
  }
  if (!best) return std::nullopt;
  best->leased = true;
  ++best_client->leases;
  best_client->last_turn = ++turns_;
  // Workers that would find nothing to do lend their core to the few objects there are.
  const int threads = std::max(1, threads_ / std::max(1, busy));
  return Lease{best_client, best, std::exchange(best->offers, {}), Complete(*best_client, *best, now), threads};
}

void TrainingPool::Work() {
  LowerThreadPriority();
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    std::optional<Lease> lease = Next(Clock::now());
    if (!lease) {
      if (const auto wake = NextSettleTime()) {
        work_changed_.wait_until(lock, *wake);
      } else {
        work_changed_.wait(lock);
      }
      continue;
    }
    Serve(*lease, lock);
  }
}

void TrainingPool::TrainSlices(uint64_t client, int count) {
  std::unique_lock lock(mutex_);
  for (int i = 0; i < count; ++i) {
    std::optional<Lease> lease = Next(Clock::now(), client);
    if (!lease) return;
    Serve(*lease, lock);
  }
}

// Runs the slice of a lease without the lock and gives the lease back.
void TrainingPool::Serve(Lease& lease, std::unique_lock<std::mutex>& lock) {
  lock.unlock();
  std::string failure;
  try {
    RunSlice(lease);
  } catch (const std::exception& e) {  // from a library, or out of memory: costs this object, not the server
    failure = e.what();
  }
  lock.lock();
  if (!failure.empty()) {
    spdlog::error("{}: training failed and is given up: {}", lease.job->id.ToString(), failure);
    auto& jobs = lease.client->jobs;
    std::erase_if(jobs, [&](const auto& entry) { return entry.second == lease.job; });
    lease.client->given_up.insert(lease.job->id);
  }
  lease.job->leased = false;
  --lease.client->leases;
  work_changed_.notify_one();
  lease_returned_.notify_all();
}

void TrainingPool::GiveTo(ObjectField& field, ObjectViews offer) {
  if (offer.S_new_old) field.Move(*offer.S_new_old);
  // What is refused the field tells itself, in its concern.
  for (const ViewPose& pose : offer.corrected_views) field.CorrectView(pose).IgnoreError();
  field.SetBox(offer.cuboid).IgnoreError();
  for (ObjectView& view : offer.new_views) field.AddView(std::move(view)).IgnoreError();
}

void TrainingPool::RunSlice(Lease& lease) {
  Job& job = *lease.job;
  if (!job.field) job.field = std::make_unique<ObjectField>(config_, job.id, job.id.value);
  ObjectField& field = *job.field;
  for (ObjectViews& offer : lease.offers) GiveTo(field, std::move(offer));
  uint64_t goal = 0;
  TrainStats stats;
  if (HasTimeLeft(job)) {
    goal = field.AllowedSteps(lease.complete);
    const uint64_t left = goal > field.steps() ? goal - field.steps() : 0;
    const int steps = static_cast<int>(std::min<uint64_t>(left, static_cast<uint64_t>(config_.slice_steps)));
    if (steps > 0) stats = field.Train(steps, lease.threads);
    goal = field.AllowedSteps(lease.complete);
  }
  bool budget_used = field.steps() >= goal;
  bool converged = false;
  {
    std::lock_guard lock(mutex_);
    job.busy_s += stats.BusySeconds();
    TakeNews(job, field);
    converged = job.StepsLeft(true) == 0;
    budget_used |= converged;  // out of time, perhaps: no later slice would send what there is
    if (job.removed || lease.client->closing || !ShouldSend(job, budget_used)) {
      if (budget_used) field.ReleaseScratch();
      return;
    }
    job.sent_steps = job.steps;
    job.sent_time = Clock::now();
  }
  FieldSnapshot snapshot = field.Snapshot();
  snapshot.converged = converged;
  if (budget_used) field.ReleaseScratch();
  lease.client->sink(std::move(snapshot));
}

// Not by hand: then nothing may depend on time.
bool TrainingPool::HasTimeLeft(const Job& job) const {
  if (threads_ == 0) return true;
  const int views = job.field ? job.field->views() : 0;
  return job.busy_s < config_.max_training_time_s + config_.max_training_time_per_view_s * views;
}

void TrainingPool::TakeNews(Job& job, const ObjectField& field) const {
  job.views = field.views();
  job.steps = field.steps();
  job.allowed_steps = HasTimeLeft(job) ? field.AllowedSteps(false) : job.steps;
  job.complete_steps = HasTimeLeft(job) ? field.AllowedSteps(true) : job.steps;
  job.loss_fall = field.LossFall().value_or(1);
  if (job.steps < job.sent_steps) job.sent_steps = 0;  // training began anew
  std::string concern = field.Concern();
  if (concern != job.concern && !concern.empty()) spdlog::warn("{}: {}", job.id.ToString(), concern);
  job.concern = std::move(concern);
}

bool TrainingPool::ShouldSend(const Job& job, bool budget_used) const {
  if (job.steps == 0 || job.steps == job.sent_steps) return false;
  if (budget_used) return true;
  if (job.steps >= job.sent_steps + static_cast<uint64_t>(config_.snapshot_interval_steps)) return true;
  const std::chrono::duration<double> age = Clock::now() - job.sent_time;
  return threads_ > 0 && age.count() >= config_.snapshot_interval_s;
}

}  // namespace romap::nerf
