#include "client/sdk/internal/link_opener.h"

#include <utility>

#include "client/sdk/retry.h"
#include "common/status.h"

namespace romap::client {

LinkOpener::Attempt LinkOpener::Open(const absl::Status& broken, const Kept& kept) {
  auto stream = service_->OpenMap(session_id_, token_);
  if (stream.ok()) {
    token_ = (*stream)->opening().resume_token;
    std::shared_ptr<MapStream> inputs = *std::move(stream);
    return {.status = absl::OkStatus(), .link = {inputs, inputs}, .retry = false};
  }
  const absl::Status& status = stream.status();
  if (absl::IsFailedPrecondition(status)) return OpenFinished(status, broken, kept);
  if (IsBrokenLink(status)) ++unanswered_;
  // Too many streams: that of the broken connection may be among them. INTERNAL may come from gRPC's transport.
  return Failed(status, IsBrokenLink(status) || absl::IsResourceExhausted(status) || absl::IsInternal(status));
}

LinkOpener::Attempt LinkOpener::Failed(const absl::Status& status, bool retry) {
  return {.status = status, .link = {}, .retry = retry};
}

// The session exists but accepts no Map stream.
LinkOpener::Attempt LinkOpener::OpenFinished(const absl::Status& refusal, const absl::Status& broken,
                                             const Kept& kept) {
  const auto info = service_->GetSession(session_id_);
  if (!info.ok()) return Failed(info.status(), IsBrokenLink(info.status()));
  switch (info->state) {
    case SessionState::kRestoring:
      return Failed(refusal, /*retry=*/true);
    case SessionState::kOpen:
      // An opening of this client whose answer was lost may hold the session, until the server notices.
      return Failed(refusal, /*retry=*/token_.empty() && (unanswered_ > 0 || !broken.ok()));
    case SessionState::kFailed:
      // The stream may have told the cause before.
      return Failed(absl::IsInternal(broken) ? broken : refusal, /*retry=*/false);
    default:
      break;
  }
  if (broken.ok() || kept.unacknowledged > 0) return Failed(refusal, /*retry=*/false);
  auto watch = service_->Watch(session_id_);
  if (!watch.ok()) return Failed(watch.status(), IsBrokenLink(watch.status()));
  // A server that was restarted may have lost what it acknowledged before it was stored.
  if (kept.newest_frame_id && (*watch)->opening().newest_frame_id.value_or(0) < *kept.newest_frame_id) {
    return Failed(refusal, /*retry=*/false);
  }
  return {.status = absl::OkStatus(), .link = {*std::move(watch), nullptr}, .retry = false};
}

bool LinkOpener::MayReopen(const absl::Status& status) {
  // A stream is replaced if an earlier opening of this client reaches the server late.
  if (absl::IsAborted(status)) {
    if (unanswered_ == 0) return false;
    --unanswered_;
    return true;
  }
  if (!absl::IsInternal(status)) return IsBrokenLink(status);
  // From gRPC's transport, or because the session failed.
  const auto info = service_->GetSession(session_id_);
  return !info.ok() || info->state != SessionState::kFailed;
}

}  // namespace romap::client
