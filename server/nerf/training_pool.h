#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/field_snapshot.h"
#include "common/stage_messages.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/object_field.h"

namespace romap::nerf {

// The server's workers that train the objects of all clients (paper: one thread pool trains all models). An object is
// leased to one worker for a slice of steps and queued again: clients take turns, and within a client the object goes
// first that is furthest from its plan, then, of those beyond their plans, the one whose loss falls fastest. The budget
// of an object grows with its views (TrainingPlan), and ends with its time. Thread-safe.
//
// A pool without workers trains only in TrainSlices(), on the caller's thread: what it does then depends on the order
// of the calls alone, never on time.
class TrainingPool {
 public:
  // Receives snapshots on worker threads (or in TrainSlices()), no two at a time of the same object, with no lock held.
  // Must not call Unregister().
  using Sink = std::function<void(FieldSnapshot)>;

  struct Progress {
    int objects_total = 0;
    int objects_training = 0;  // with steps left or views waiting
    uint64_t steps = 0;        // done on all objects that are still there
    double progress = 0;       // 0..1, mean over objects of steps done / steps planned; 1 without objects
    // What is wrong with what objects were given, for people: see ObjectField::Concern.
    std::vector<std::pair<ObjectId, std::string>> concerns = {};
  };

  // `threads` workers; 0 = none.
  TrainingPool(const NerfConfig& config, int threads);
  // Ends all clients; running slices are finished first.
  ~TrainingPool();
  TrainingPool(const TrainingPool&) = delete;
  TrainingPool& operator=(const TrainingPool&) = delete;

  // A new client; the result names it in all other calls. Calls with an unknown client do nothing.
  uint64_t Register(Sink sink);
  // What is new about an object: corrections, cuboid, views. Taken in the order of the calls, between slices. What
  // cannot be used is left out, and so is all of an object whose training failed; what is wrong is logged, once.
  void Offer(uint64_t client, ObjectViews views);
  // The object is gone (merged, or an error). A snapshot already on its way may still arrive.
  void Remove(uint64_t client, ObjectId object);
  // No more views will come: every object is trained to the end of its plan.
  void Finish(uint64_t client);
  // For a pool without workers: trains this client's objects for at most `count` slices; fewer when there is nothing
  // more to do.
  void TrainSlices(uint64_t client, int count);
  Progress GetProgress(uint64_t client) const;
  // Nothing is being trained, waits to be, or would be if only time passed. Objects without enough views do not count.
  bool Idle(uint64_t client) const;
  // Waits until no slice of this client runs and no call of its sink is in flight; none follows.
  void Unregister(uint64_t client);

 private:
  using Clock = std::chrono::steady_clock;
  struct Job;
  struct Client;
  struct Lease;

  void Work();
  std::optional<Lease> Next(Clock::time_point now, std::optional<uint64_t> only_client = std::nullopt);
  void Serve(Lease& lease, std::unique_lock<std::mutex>& lock);
  void RunSlice(Lease& lease);
  static void GiveTo(ObjectField& field, ObjectViews offer);
  void TakeNews(Job& job, const ObjectField& field) const;
  bool HasTimeLeft(const Job& job) const;
  bool ShouldSend(const Job& job, bool budget_used) const;
  bool Complete(const Client& client, const Job& job, Clock::time_point now) const;
  bool Runnable(const Client& client, const Job& job, Clock::time_point now) const;
  std::optional<Clock::time_point> NextSettleTime() const;

  const NerfConfig config_;
  const int threads_;  // 0: by hand
  mutable std::mutex mutex_;
  std::condition_variable work_changed_;  // something became runnable, or stop
  std::condition_variable lease_returned_;
  std::map<uint64_t, std::unique_ptr<Client>> clients_;
  uint64_t next_client_ = 1;
  uint64_t turns_ = 0;
  bool stopping_ = false;
  std::vector<std::jthread> workers_;
};

}  // namespace romap::nerf
