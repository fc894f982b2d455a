#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/field_snapshot.h"
#include "common/stage_messages.h"
#include "server/nerf/fair_share.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/training_job.h"
#include "server/nerf/training_policy.h"

namespace romap::nerf {

// Id of a session in the training queue. 0: none.
using TrainingSessionId = uint64_t;

// Whose objects are trained.
struct TrainingOwner {
  std::string session_id = {};  // for the log
  std::string tenant = {};      // tenants get equal shares of the CPU time
};

struct TrainingProgress {
  int objects_total = 0;
  int objects_training = 0;  // with steps left or updates pending
  uint64_t steps = 0;        // total over all objects of the session, without removed ones
  double progress = 0;       // 0..1, mean over the objects of steps done / steps planned; 1 without objects
};

// The training jobs of all sessions. Grants leases: the right to train one object for a slice. The tenants share the
// CPU time equally, and the sessions of a tenant share the tenant's (FairShare); within a session, TrainingPolicy
// decides. Not thread-safe. Calls with an unknown session have no effect.
class TrainingQueue {
 public:
  using Time = TrainingJob::Clock::time_point;
  using Sink = std::function<void(FieldSnapshot)>;

  struct Session {
    Sink sink;
    std::map<ObjectId, std::shared_ptr<TrainingJob>> jobs;
    std::set<ObjectId> abandoned;  // a new job would lack the earlier views and corrections
    bool finished = false;         // no more views are expected
    bool closing = false;          // no more leases
    int leases = 0;                // not yet returned
    TrainingOwner owner;
    FairShare::Account share;  // of its tenant's time
    uint64_t last_turn = 0;
  };

  struct Lease {
    Session* session;  // valid until the lease is returned
    std::shared_ptr<TrainingJob> job;
    std::vector<ObjectViews> updates;  // to be applied to the field
    bool complete = false;             // no more views are expected
    int threads = 1;                   // to train on
  };

  TrainingQueue(const NerfConfig& config, int workers);

  TrainingSessionId AddSession(Sink sink, const TrainingOwner& owner = {});
  // Null if there is no such session. Valid until ExtractSession().
  Session* FindSession(TrainingSessionId session);
  const Session* FindSession(TrainingSessionId session) const;
  // Removes the session, without outstanding leases, from the queue. Null if there is none.
  std::unique_ptr<Session> ExtractSession(TrainingSessionId session);

  // Ignored if the session is closing or the object was abandoned.
  void AddUpdate(TrainingSessionId session, ObjectViews update);
  // Removes the object's job from the queue and returns it; null if there is none.
  std::shared_ptr<TrainingJob> RemoveObject(TrainingSessionId session, ObjectId object);

  // Leases the most urgent runnable job of the session whose turn it is, or of `only_session`.
  std::optional<Lease> Next(Time now, std::optional<TrainingSessionId> only_session = std::nullopt);
  // `cost_s`: the CPU time of the slice.
  void Return(const Lease& lease, double cost_s);
  // Removes the leased job, and ignores the object from now on.
  void Abandon(const Lease& lease);
  // When the next job becomes complete, and thereby runnable, if nothing else happens.
  std::optional<Time> NextCompletionTime() const;

  TrainingProgress Progress(TrainingSessionId session) const;
  // True if no object is being trained, is waiting to be trained, or would be trained later without new input. Objects
  // with too few views do not count.
  bool IsIdle(TrainingSessionId session) const;

  const TrainingPolicy& policy() const { return policy_; }

 private:
  struct Tenant {
    FairShare::Account share;
    FairShare among_sessions;
  };
  // What a session would train next.
  struct Candidate {
    Session* session = nullptr;
    std::shared_ptr<TrainingJob> job;
  };

  std::shared_ptr<TrainingJob> MostUrgentJob(const Session& session, Time now, int* runnable) const;
  void UpdateShares(const std::vector<Candidate>& candidates);
  double TenantClaim_s(const Session& session) const;

  const TrainingPolicy policy_;
  const int workers_;
  std::map<TrainingSessionId, std::unique_ptr<Session>> sessions_;
  std::map<std::string, Tenant> tenants_;  // that have sessions
  FairShare among_tenants_;
  TrainingSessionId next_session_ = 1;
  uint64_t turns_ = 0;
};

}  // namespace romap::nerf
