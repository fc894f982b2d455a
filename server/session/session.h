#pragma once

#include <absl/status/status.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "common/mapping_service.h"
#include "common/random_id.h"
#include "common/wire/recording.h"
#include "server/nerf/training_pool.h"
#include "server/session/frame_ledger.h"
#include "server/session/map_state.h"
#include "server/session/mesher.h"
#include "server/session/pipeline.h"
#include "server/session/scheduler.h"
#include "server/session/sender_claim.h"
#include "server/session/server_config.h"
#include "server/session/service_counters.h"
#include "server/session/session_lifecycle.h"
#include "server/session/session_storage.h"
#include "server/store/store.h"

namespace romap::session {

// One client's map and its life cycle: open -> finishing -> finished, or failed. Pipeline defines how a frame is
// processed, Scheduler on which thread; FrameLedger counts and acknowledges; MapState is the map that clients see.
//
// A session that was stored is restored after a restart of the server: clients see its stored map while the pipeline
// makes the map again from the stored inputs, from which it then goes on.
//
// Accepted inputs are never lost while the session exists; closing a stream has no effect on them. Thread-safe.
class Session {
 public:
  // What the session uses of the server; all outlive it.
  struct Services {
    nerf::TrainingPool* pool = nullptr;
    Mesher* mesher = nullptr;
    store::Store* store = nullptr;        // null: the session is not stored
    ServiceCounters* counters = nullptr;  // may be null
  };
  // A stored session to restore.
  struct Stored {
    SessionState state = SessionState::kOpen;  // open or finishing
    uint64_t inputs = 0;
    std::shared_ptr<MapState> map;        // serves clients until the session is restored
    std::vector<ObjectSnapshot> objects;  // of the map
    Statistics statistics;
    bool pinned = false;
  };

  // The constructors throw if the process has no more threads or memory.
  //
  // A new session. `recorder` gets every accepted input; null: not recorded.
  Session(std::string id, const SessionOptions& options, int64_t created_unix_ns, const ServerConfig& config,
          const Services& services, std::unique_ptr<wire::RecordingWriter> recorder = nullptr);
  // Starts to restore a session.
  Session(std::string id, const SessionOptions& options, int64_t created_unix_ns, const ServerConfig& config,
          const Services& services, Stored stored);
  ~Session();

  SessionInfo Info() const;
  MapSnapshot Export() const;
  // Its newest image and points.
  const LiveView& live_view() const { return pipeline_.live_view(); }
  SessionState state() const { return lifecycle_.state(); }

  // As SessionLifecycle::CheckOpen().
  absl::Status CheckOpen() const { return lifecycle_.CheckOpen(); }
  // Queues a frame, or the masks of an earlier frame; the FrameAck or MasksAck follows as an event. If the queue is
  // full, kReplay waits and kLive drops the oldest input. An error as CheckOpen().
  absl::Status Offer(SessionInput input);
  // No more inputs. Returns immediately; the state becomes kFinished after everything is mapped and trained.
  void Finish();
  // Ends the threads without completing the training, and ends every stream with `status`. Called before deletion.
  void Stop(const absl::Status& status);
  // Fails the session if one of its stages hangs (session.stage_timeout_s), and logs where.
  void CheckStages();
  // A thread of the session does not return: Stop() and the destructor would wait for it.
  bool hangs() const { return hangs_; }
  // Stores what has changed. `complete`: also what is stored only now and then. Does nothing while it is restored.
  void StoreChanges(bool complete);
  void StoreState();

  // The right to send inputs.
  SenderClaim& sender() { return sender_; }
  std::optional<uint64_t> newest_frame_id() const { return ledger_.newest_frame_id(); }
  // Calls `done` when all inputs offered before this call are settled: immediately or on a session thread.
  void WhenSettled(std::function<void()> done) { ledger_.WhenSettled(std::move(done)); }

  // See MapState.
  std::shared_ptr<Outbox> Subscribe(Outbox::Acks acks, size_t max_acks, std::vector<ObjectId>* objects);
  void Unsubscribe(const std::shared_ptr<Outbox>& outbox);
  const SessionConfig& config() const { return config_; }
  const CameraModel& camera() const { return options_.camera; }
  bool is_durable() const { return storage_ != nullptr; }
  void SetPinned(bool pinned) { pinned_ = pinned; }
  // The cores that the session needs for its live client, see LiveLoad; nullopt: not known yet. 0 for a session that
  // has no live client.
  std::optional<double> LiveCores() const;
  // Nobody sends or watches, and everything is mapped and trained.
  bool IsIdle() const;
  // The same, and no input was ever accepted. Never a pinned session.
  bool IsEmpty() const { return !pinned_ && !newest_frame_id() && state() == SessionState::kOpen && IsIdle(); }

 private:
  using Clock = std::chrono::steady_clock;

  Session(std::string id, const SessionOptions& options, int64_t created_unix_ns, const ServerConfig& config,
          const Services& services, SessionState state, std::shared_ptr<MapState> stored_map);

  Scheduler::Callbacks SchedulerCallbacks();
  store::Store::Listener StoreListener();
  void OnAccepted(const SessionInput& input);
  void Restore(Stored stored);
  void RestoreMap(Stored stored);
  void OfferStoredInputs(uint64_t inputs);
  SessionStorage::State StateToStore() const;
  void PublishStatisticsIfDue();
  void OnFinished();
  void OnFailed(const char* stage, const std::string& what);
  Statistics CurrentStatistics() const;

  // Destroyed after the rest. Otherwise the allocator keeps most of the memory of the session.
  struct ReturnsMemory {
    ~ReturnsMemory();
  };

  const ReturnsMemory returns_memory_;
  const std::string id_;
  const SessionOptions options_;
  const SessionConfig config_;
  const int64_t created_unix_ns_;
  store::Store* const store_;

  SessionLifecycle lifecycle_;
  SenderClaim sender_{RandomId()};
  Clock::time_point next_statistics_ = Clock::now();  // the scheduler's mapping thread

  MapState map_;
  const std::shared_ptr<MapState> stored_map_;  // serves clients until the session is restored; null: it is new
  Statistics stored_statistics_;                // the same
  std::atomic<bool> restoring_ = false;
  std::atomic<bool> finish_after_restoring_ = false;
  std::atomic<bool> stopping_ = false;
  std::atomic<bool> pinned_ = false;
  std::atomic<bool> hangs_ = false;
  FrameLedger ledger_;
  DiagnosticLog diagnostics_;
  std::unique_ptr<SessionStorage> storage_;          // null: not stored
  std::unique_ptr<wire::RecordingWriter> recorder_;  // the ingest thread; null: not recorded, or recording failed
  Pipeline pipeline_;
  Scheduler scheduler_;  // its threads use all of the above
  std::thread restore_thread_;
};

}  // namespace romap::session
