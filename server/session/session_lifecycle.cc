#include "server/session/session_lifecycle.h"

#include "common/status.h"

namespace romap::session {

absl::Status SessionLifecycle::CheckOpen() const {
  const SessionState state = state_;
  if (state == SessionState::kOpen) return absl::OkStatus();
  if (state != SessionState::kFailed) {
    return FailedPrecondition("session '{}' was finished and accepts no more frames", session_id_);
  }
  std::lock_guard lock(mutex_);
  return FailedPrecondition("session '{}' accepts no more frames, because {}", session_id_, failure_);
}

void SessionLifecycle::BeginFinish() {
  SessionState open = SessionState::kOpen;
  state_.compare_exchange_strong(open, SessionState::kFinishing);
}

void SessionLifecycle::Fail(const std::string& cause) {
  {
    std::lock_guard lock(mutex_);
    if (failure_.empty()) failure_ = cause;
  }
  state_ = SessionState::kFailed;
}

}  // namespace romap::session
