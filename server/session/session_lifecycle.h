#pragma once

#include <absl/status/status.h>

#include <atomic>
#include <mutex>
#include <string>
#include <utility>

#include "common/mapping_service.h"

namespace romap::session {

// The state of a session: restoring, if it was stored; open, then finishing, then finished; or failed, with the cause.
// Thread-safe.
class SessionLifecycle {
 public:
  explicit SessionLifecycle(std::string session_id, SessionState state = SessionState::kOpen)
      : session_id_(std::move(session_id)), state_(state) {}

  SessionState state() const { return state_; }
  // OK; UNAVAILABLE: it is being restored; FAILED_PRECONDITION: finished or failed, and why.
  absl::Status CheckOpen() const;

  void BeginFinish();   // no effect unless open
  void EndRestoring();  // open; no effect unless restoring
  void Finish() { state_ = SessionState::kFinished; }
  // `cause`: a clause such as "mapping failed: ...". The first cause is kept.
  void Fail(const std::string& cause);
  std::string failure() const;  // the cause; empty unless failed

 private:
  const std::string session_id_;
  std::atomic<SessionState> state_;
  mutable std::mutex mutex_;
  std::string failure_;  // set before state_ becomes kFailed
};

}  // namespace romap::session
