#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "common/field_snapshot.h"
#include "common/stage_messages.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/object_field.h"
#include "server/nerf/training_queue.h"

namespace romap::nerf {

// The server's worker threads, which train the objects of all sessions (paper: one thread pool trains all models). A
// worker leases an object for a slice of steps; see TrainingQueue for the order. The number of steps of an object is
// limited by its views (TrainingPlan) and by its total training time. Thread-safe.
//
// A pool without workers trains only in TrainSlices(), on the thread of the caller. Then the result depends only on the
// order of the calls, and never on time.
class TrainingPool {
 public:
  using SessionId = TrainingSessionId;
  using Progress = TrainingProgress;
  // Receives snapshots on worker threads (or in TrainSlices()) without a lock held, and never two of the same object
  // concurrently. Must not call RemoveSession().
  using Sink = TrainingQueue::Sink;

  // `workers` threads; 0 = none.
  TrainingPool(const NerfConfig& config, int workers);
  // Waits for running slices, then removes all sessions.
  ~TrainingPool();
  TrainingPool(const TrainingPool&) = delete;
  TrainingPool& operator=(const TrainingPool&) = delete;

  // Adds a session and returns its id. Calls with an unknown id have no effect.
  SessionId AddSession(Sink sink, const TrainingOwner& owner = {});
  // Waits until no slice of the session runs and no call of its sink is in progress; none follows.
  void RemoveSession(SessionId session);

  // Adds an update of one object: correction, cuboid and views. Updates are applied between slices, in the order of the
  // calls. Invalid parts are rejected and logged. Ignored if the training of the object failed before.
  void Offer(SessionId session, ObjectViews update);
  // Removes an object that no longer exists. A snapshot that is already being sent may still arrive.
  void RemoveObject(SessionId session, ObjectId object);
  // No more views will arrive: trains every object to the end of its plan.
  void Finish(SessionId session);

  // For a pool without workers: trains the session's objects for at most `count` slices, fewer if no steps are left.
  void TrainSlices(SessionId session, int count);

  Progress GetProgress(SessionId session) const;
  // See TrainingQueue::IsIdle.
  bool IsIdle(SessionId session) const;

 private:
  void RunWorker();
  void RunLease(TrainingQueue::Lease& lease, std::unique_lock<std::mutex>& lock);
  double RunSlice(TrainingQueue::Lease& lease);
  static void ApplyUpdate(ObjectField& field, ObjectViews update);
  TrainStats TrainField(ObjectField& field, const TrainingQueue::Lease& lease) const;
  void UpdateJob(TrainingJob& job, const TrainStats& stats) const;

  const NerfConfig config_;
  mutable std::mutex mutex_;
  std::condition_variable work_changed_;  // a job became runnable, or stopping_ was set
  std::condition_variable lease_returned_;
  TrainingQueue queue_;  // guarded by mutex_, except for the field of a leased job
  bool stopping_ = false;
  std::vector<std::jthread> workers_;
};

}  // namespace romap::nerf
