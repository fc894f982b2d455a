#pragma once

#include <absl/status/status.h>
#include <grpcpp/client_context.h>
#include <grpcpp/support/client_callback.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "common/map_events.h"
#include "common/mapping_service.h"
#include "common/status.h"
#include "common/wire/events.h"
#include "common/wire/sessions.h"
#include "common/wire/status.h"

namespace romap::client {

// The receiving half of a stream. Buffers up to kMaxEvents events for Next() and stops reading while the buffer is
// full, so that HTTP/2 flow control reaches the server, which then coalesces pending events.
//
// Reactor: grpc::ClientReadReactor<Response>, or a ClientBidiReactor that reads Response.
// Usage: construct; pass context() and this to the stub's async call; call Begin() once; then call any method. The
// destructor cancels the call. All public methods are thread-safe after Begin().
template <class Reactor, class Response>
class EventReactor : public Reactor {
 public:
  // The derived destructor must call Shutdown() while its own members still exist.
  ~EventReactor() override = default;

  grpc::ClientContext* context() { return &context_; }

  // Starts the call and waits for the `opened` message of the server. Errors: DEADLINE_EXCEEDED after `timeout`;
  // INTERNAL if the server ended the stream with OK before it opened; otherwise the status of the call.
  absl::Status Begin(std::chrono::milliseconds timeout) {
    // A gRPC hold keeps the call alive while no read or write is pending. OnReadDone(false) releases it.
    this->AddHold();
    this->StartRead(&response_);
    this->StartCall();
    std::unique_lock lock(mutex_);
    const bool finished = changed_.wait_for(lock, timeout, [&] { return opened_ || done_; });
    if (opened_) return absl::OkStatus();
    if (finished) return status_.ok() ? Internal("the server closed the stream before opening it") : status_;
    lock.unlock();
    Cancel();
    return absl::DeadlineExceededError(fmt::format("the server did not open the stream within {} ms", timeout.count()));
  }

  // Call after Begin().
  const StreamOpening& opening() const { return opening_; }

  // As EventStream::Next().
  std::optional<MapEvent> Next(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, timeout, [&] { return done_ || !events_.empty(); });
    if (events_.empty()) return std::nullopt;
    std::optional<MapEvent> event(std::move(events_.front()));
    events_.pop_front();
    ResumeReading(lock);
    return event;
  }

  bool Done() const {
    std::lock_guard lock(mutex_);
    return done_ && events_.empty();
  }

  absl::Status status() const {
    std::lock_guard lock(mutex_);
    return done_ ? status_ : absl::OkStatus();
  }

  void Cancel() {
    context_.TryCancel();
    Drain(/*keep_events=*/false);
  }

  void OnReadDone(bool ok) final {
    if (!ok) {
      {
        std::lock_guard lock(mutex_);
        ended_ = true;
      }
      this->RemoveHold();
      return;
    }
    bool continue_reading = true;
    {
      std::lock_guard lock(mutex_);
      Store(response_);
      continue_reading = draining_ || events_.size() < kMaxEvents;
      paused_ = !continue_reading;
      changed_.notify_all();
    }
    if (continue_reading) this->StartRead(&response_);
  }

  void OnDone(const grpc::Status& status) final {
    std::lock_guard lock(mutex_);
    status_ = wire::FromGrpc(status);
    done_ = true;
    changed_.notify_all();
  }

 protected:
  // Adds a gRPC hold for an operation about to start. Returns false, without a hold, if the stream has ended and no
  // operation may start.
  bool HoldUnlessEnded() {
    std::lock_guard lock(mutex_);
    if (!ended_) this->AddHold();
    return !ended_;
  }

  void Deliver(MapEvent event) {
    std::lock_guard lock(mutex_);
    events_.push_back(std::move(event));
    changed_.notify_all();
  }

  // Waits for the end of a stream whose last operation failed and returns its final status.
  absl::Status EndStatus() {
    Drain(/*keep_events=*/true);
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return done_; });
    return status_;
  }

  // Cancels the call and waits for OnDone(), after which gRPC no longer uses this object.
  void Shutdown() {
    Cancel();
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return done_; });
  }

 private:
  static constexpr size_t kMaxEvents = 256;

  // Buffers the event of a response. Requires mutex_.
  void Store(Response& response) {
    if (response.has_opened()) {
      opening_ = wire::FromProto(std::move(*response.mutable_opened()));
      opened_ = true;
    }
    if (discarding_ || !response.has_event()) return;
    if (response.event().event_case() == v1::MapEvent::EVENT_NOT_SET) return;  // event type of a newer server
    auto event = wire::FromProto(std::move(*response.mutable_event()), "event");
    if (event.ok()) {
      events_.push_back(*std::move(event));
    } else {
      spdlog::warn("ignored a malformed event from the server: {}", Message(event.status()));
    }
  }

  // Reads until the end of the stream regardless of the buffer size: gRPC completes a call only after all messages are
  // read. Discards the buffered and later events unless `keep_events`.
  void Drain(bool keep_events) {
    std::unique_lock lock(mutex_);
    draining_ = true;
    discarding_ = discarding_ || !keep_events;
    ResumeReading(lock);
  }

  // Starts the next read if reading is paused and may resume. Unlocks `lock` before calling gRPC.
  void ResumeReading(std::unique_lock<std::mutex>& lock) {
    if (!paused_ || !(draining_ || events_.size() < kMaxEvents)) return;
    paused_ = false;
    lock.unlock();
    // Safe: Begin()'s hold is released only by a failed read.
    this->StartRead(&response_);
  }

  grpc::ClientContext context_;
  Response response_;  // target of the pending read

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<MapEvent> events_;
  bool opened_ = false;
  StreamOpening opening_;    // written once, before opened_ is set
  bool paused_ = false;      // no read is pending because the buffer is full
  bool draining_ = false;    // read to the end without pausing
  bool discarding_ = false;  // drop all further events
  bool ended_ = false;       // a read failed: no further operation may start
  bool done_ = false;        // OnDone() was called; status_ is final
  absl::Status status_;
};

}  // namespace romap::client
