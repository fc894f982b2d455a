#include "server/session/session_lifecycle.h"

#include "common/status.h"

namespace romap::session {

absl::Status SessionLifecycle::CheckOpen() const {
  const SessionState state = state_;
  if (state == SessionState::kOpen) return absl::OkStatus();
  if (state == SessionState::kRestoring) {
    return absl::UnavailableError(
        fmt::format("session '{}' is being restored from the store; try again soon", session_id_));
  }
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

void SessionLifecycle::EndRestoring() {
  SessionState restoring = SessionState::kRestoring;
  state_.compare_exchange_strong(restoring, SessionState::kOpen);
}

std::string SessionLifecycle::failure() const {
  std::lock_guard lock(mutex_);
  return failure_;
}

void SessionLifecycle::Fail(const std::string& cause) {
  {
    std::lock_guard lock(mutex_);
    if (failure_.empty()) failure_ = cause;
  }
  state_ = SessionState::kFailed;
}

}  // namespace romap::session
