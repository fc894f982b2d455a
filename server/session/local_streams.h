#pragma once

#include <absl/status/status.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <utility>

#include "common/mapping_service.h"
#include "common/status.h"
#include "server/session/map_state.h"
#include "server/session/outbox.h"
#include "server/session/sender_claim.h"
#include "server/session/session.h"

namespace romap::session {

// A stream of a stored map that is not in memory otherwise.
class ShelfStream : public EventStream {
 public:
  ShelfStream(std::shared_ptr<MapState> map, uint64_t newest_frame_id) : map_(std::move(map)) {
    if (newest_frame_id > 0) opening_.newest_frame_id = newest_frame_id;
    outbox_ = map_->Subscribe(Outbox::Acks::kNewest, /*max_acks=*/1, &opening_.objects);
    opening_.durable = true;
  }
  ~ShelfStream() override { Cancel(); }

  const StreamOpening& opening() const override { return opening_; }
  std::optional<MapEvent> Next(std::chrono::milliseconds timeout) override { return outbox_->Next(timeout); }
  bool Done() const override { return outbox_->Done(); }
  absl::Status status() const override { return outbox_->status(); }
  void Cancel() override {
    map_->Unsubscribe(outbox_);
    outbox_->Close(absl::CancelledError("the stream was canceled"));
  }

 private:
  const std::shared_ptr<MapState> map_;
  std::shared_ptr<Outbox> outbox_;
  StreamOpening opening_;
};

class LocalEventStream : public MapStream {
 public:
  // `holder`: null for a stream that only watches.
  LocalEventStream(std::shared_ptr<Session> session, std::shared_ptr<Outbox> outbox, StreamOpening opening,
                   std::shared_ptr<SenderClaim::Holder> holder)
      : session_(std::move(session)),
        outbox_(std::move(outbox)),
        opening_(std::move(opening)),
        holder_(std::move(holder)),
        sending_(holder_ != nullptr) {}

  ~LocalEventStream() override { Cancel(); }

  const StreamOpening& opening() const override { return opening_; }
  std::optional<MapEvent> Next(std::chrono::milliseconds timeout) override { return outbox_->Next(timeout); }
  bool Done() const override { return outbox_->Done(); }
  absl::Status status() const override { return outbox_->status(); }

  absl::Status Send(FrameInput frame) override { return Offer(std::move(frame)); }
  absl::Status SendMasks(MasksInput masks) override { return Offer(std::move(masks)); }

  absl::Status CloseSend() override {
    if (!StopSending()) return SendingEnded();
    session_->WhenSettled([outbox = outbox_] { outbox->Close(); });
    return absl::OkStatus();
  }

  void Cancel() override {
    StopSending();
    session_->Unsubscribe(outbox_);
    outbox_->Close(absl::CancelledError("the stream was canceled"));
  }

 private:
  absl::Status Offer(SessionInput input) {
    if (!sending_) return SendingEnded();
    absl::Status status;
    if (holder_->Run([&] { status = session_->Offer(std::move(input)); })) return status;
    return outbox_->status().ok() ? SendingEnded() : outbox_->status();
  }

  static absl::Status SendingEnded() {
    return FailedPrecondition("sending has ended on this stream: CloseSend() or Cancel() was called");
  }

  bool StopSending() {
    if (!sending_.exchange(false)) return false;
    session_->sender().Release(holder_);
    return true;
  }

  const std::shared_ptr<Session> session_;
  const std::shared_ptr<Outbox> outbox_;
  const StreamOpening opening_;
  const std::shared_ptr<SenderClaim::Holder> holder_;
  std::atomic<bool> sending_;
};

}  // namespace romap::session
