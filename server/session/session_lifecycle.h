#pragma once

#include <absl/status/status.h>

#include <atomic>
#include <mutex>
#include <string>
#include <utility>

#include "common/mapping_service.h"

namespace romap::session {

// The state of a session: open, then finishing, then finished; or failed, with the cause. Thread-safe.
class SessionLifecycle {
 public:
  explicit SessionLifecycle(std::string session_id) : session_id_(std::move(session_id)) {}

  SessionState state() const { return state_; }
  // OK, or FAILED_PRECONDITION: finished or failed, and why.
  absl::Status CheckOpen() const;

  void BeginFinish();  // no effect unless open
  void Finish() { state_ = SessionState::kFinished; }
  // `cause`: a clause such as "mapping failed: ...". The first cause is kept.
  void Fail(const std::string& cause);

 private:
  const std::string session_id_;
  std::atomic<SessionState> state_ = SessionState::kOpen;
  mutable std::mutex mutex_;
  std::string failure_;  // set before state_ becomes kFailed
};

}  // namespace romap::session
