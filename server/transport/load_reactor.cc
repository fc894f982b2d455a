#include "server/transport/load_reactor.h"

#include <utility>

#include "common/status.h"
#include "common/wire/sessions.h"
#include "common/wire/status.h"

namespace romap::transport {

void LoadReactor::Start() {
  if (!caller_.ok()) return Finish(wire::ToGrpc(caller_.status()));
  const absl::Status launched = host_->Launch(this, [this] {
    const absl::Status status = Guarded([this] { return Run(); });
    // gRPC may delete this object after Finish().
    Finish(wire::ToGrpc(status));
  });
  if (!launched.ok()) Finish(wire::ToGrpc(launched));
}

void LoadReactor::OnDone() {
  host_->Unregister(this);
  delete this;
}

void LoadReactor::RequestStop(const absl::Status& reason) {
  std::lock_guard lock(mutex_);
  if (!stop_reason_) stop_reason_ = reason;
  read_.Abandon();
}

absl::Status LoadReactor::Run() {
  ROMAP_ASSIGN_OR_RETURN(const SessionInfo info, caller_->service->LoadSession([this] { return NextPiece(); }));
  *response_->mutable_session() = wire::ToProto(info);
  return absl::OkStatus();
}

absl::StatusOr<std::string> LoadReactor::NextPiece() {
  while (true) {
    StartRead(&request_);
    const std::optional<bool> read = read_.Wait();
    if (!read) {
      std::lock_guard lock(mutex_);
      return stop_reason_.value_or(absl::CancelledError("the call was stopped"));
    }
    if (!*read) return std::string();                                            // the client has sent everything
    if (!request_.piece().empty()) return std::move(*request_.mutable_piece());  // an empty one is not the end
  }
}

}  // namespace romap::transport
