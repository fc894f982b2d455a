#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "common/mapping_service.h"
#include "common/wire/recording.h"
#include "server/nerf/training_pool.h"
#include "server/session/frame_ledger.h"
#include "server/session/map_state.h"
#include "server/session/mesher.h"
#include "server/session/pipeline.h"
#include "server/session/scheduler.h"
#include "server/session/sender_claim.h"
#include "server/session/server_config.h"
#include "server/session/session_lifecycle.h"

namespace romap::session {

// One client's map and its life cycle: open -> finishing -> finished, or failed. Pipeline defines how a frame is
// processed, Scheduler on which thread; FrameLedger counts and acknowledges; MapState is the map that clients see.
//
// Accepted inputs are never lost while the session exists; closing a stream has no effect on them. Thread-safe.
class Session {
 public:
  // `pool` and `mesher` outlive the session. `recorder` gets every accepted input; null: not recorded.
  Session(std::string id, const SessionOptions& options, const ServerConfig& config, nerf::TrainingPool* pool,
          Mesher* mesher, std::unique_ptr<wire::RecordingWriter> recorder = nullptr);
  ~Session();

  SessionInfo Info() const;
  MapSnapshot Export() const;

  // FAILED_PRECONDITION if the session accepts no more inputs.
  absl::Status CheckOpen() const { return lifecycle_.CheckOpen(); }
  // Queues a frame, or the masks of an earlier frame; the FrameAck or MasksAck follows as an event. If the queue is
  // full, kReplay waits and kLive drops the oldest input. FAILED_PRECONDITION as CheckOpen().
  absl::Status Offer(SessionInput input);
  // No more inputs. Returns immediately; the state becomes kFinished after everything is mapped and trained.
  void Finish();
  // Ends the threads without completing the training, and ends every stream with `status`. Called before deletion.
  void Stop(const absl::Status& status);

  // The right to send inputs.
  SenderClaim& sender() { return sender_; }
  std::optional<uint64_t> newest_frame_id() const { return ledger_.newest_frame_id(); }
  // Calls `done` when all inputs offered before this call are settled: immediately or on a session thread.
  void WhenSettled(std::function<void()> done) { ledger_.WhenSettled(std::move(done)); }

  MapState& map() { return map_; }
  const SessionConfig& config() const { return config_; }

 private:
  using Clock = std::chrono::steady_clock;

  Scheduler::Callbacks SchedulerCallbacks();
  void PublishStatisticsIfDue();
  void OnFinished();
  void OnFailed(const char* stage, const std::string& what);
  Statistics CurrentStatistics() const;

  const std::string id_;
  const SessionOptions options_;
  const SessionConfig config_;
  const int64_t created_unix_ns_;

  SessionLifecycle lifecycle_;
  SenderClaim sender_{MakeRandomToken()};
  Clock::time_point next_statistics_ = Clock::now();  // the scheduler's mapping thread

  MapState map_;
  FrameLedger ledger_;
  DiagnosticLog diagnostics_;
  Pipeline pipeline_;
  Scheduler scheduler_;  // last: its threads use all of the above
};

}  // namespace romap::session
