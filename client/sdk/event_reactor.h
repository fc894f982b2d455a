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
#include "common/status.h"
#include "common/wire/events.h"
#include "common/wire/status.h"

namespace romap::client {

// The receiving half of a stream: keeps a few events for Next() and stops reading while nobody takes them, so that
// HTTP/2 pushes back to the server, which coalesces what waits.
//
// Reactor: grpc::ClientReadReactor<Response>, or a ClientBidiReactor that reads Response.
// Usage: construct, let the stub bind context() and this, Begin(), then anything; destroy whenever.
template <class Reactor, class Response>
class EventReactor : public Reactor {
 public:
  // The derived destructor must call Shut(), while its own members are still alive.
  ~EventReactor() override = default;

  grpc::ClientContext* context() { return &context_; }

  // Starts the call and waits for the server to say that the stream is open. Otherwise the status it ended with.
  absl::Status Begin(std::chrono::milliseconds timeout) {
    // gRPC's "hold" keeps the call alive while neither a read nor a write is under way. It is given back when the
    // server's last message has been read.
    this->AddHold();
    this->StartRead(&response_);
    this->StartCall();
    std::unique_lock lock(mutex_);
    const bool answered = changed_.wait_for(lock, timeout, [&] { return opened_ || done_; });
    if (opened_) return absl::OkStatus();
    if (answered) return status_.ok() ? Internal("the server ended the stream before it was open") : status_;
    lock.unlock();
    Cancel();
    return absl::DeadlineExceededError(fmt::format("the server did not open the stream in {} ms", timeout.count()));
  }

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
    bool read_on = true;
    {
      std::lock_guard lock(mutex_);
      Take(response_);
      read_on = draining_ || events_.size() < kMaxEvents;
      paused_ = !read_on;
      changed_.notify_all();
    }
    if (read_on) this->StartRead(&response_);
  }

  void OnDone(const grpc::Status& status) final {
    std::lock_guard lock(mutex_);
    status_ = wire::FromGrpc(status);
    done_ = true;
    changed_.notify_all();
  }

 protected:
  // Takes a hold for an operation that is about to start. False when the stream is over and none may start.
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

  // For a stream that has broken: waits for the status that it ended with.
  absl::Status EndStatus() {
    Drain(/*keep_events=*/true);
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return done_; });
    return status_;
  }

  // Cancels the call and waits until gRPC has let go of this object.
  void Shut() {
    Cancel();
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return done_; });
  }

 private:
  static constexpr size_t kMaxEvents = 256;

  // Under mutex_.
  void Take(Response& response) {
    if (response.has_opened()) opened_ = true;
    if (discarding_ || !response.has_event()) return;
    if (response.event().event_case() == v1::MapEvent::EVENT_NOT_SET) return;  // of a newer server
    auto event = wire::FromProto(std::move(*response.mutable_event()), "event");
    if (event.ok()) {
      events_.push_back(*std::move(event));
    } else {
      spdlog::warn("an event was skipped: {}", Message(event.status()));
    }
  }

  // Reads to the end without regard to how much waits; gRPC ends a call only when everything was read.
  void Drain(bool keep_events) {
    std::unique_lock lock(mutex_);
    draining_ = true;
    discarding_ = discarding_ || !keep_events;
    ResumeReading(lock);
  }

  // Unlocks `lock` before it calls gRPC.
  void ResumeReading(std::unique_lock<std::mutex>& lock) {
    if (!paused_ || !(draining_ || events_.size() < kMaxEvents)) return;
    paused_ = false;
    lock.unlock();
    // The hold of Begin() is still there: it is only given back by a read that fails.
    this->StartRead(&response_);
  }

  grpc::ClientContext context_;
  Response response_;  // of the read under way

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<MapEvent> events_;
  bool opened_ = false;
  bool paused_ = false;      // no read is under way because enough events wait
  bool draining_ = false;    // never pause again
  bool discarding_ = false;  // nobody wants further events
  bool ended_ = false;       // the last read failed: no operation may start any more
  bool done_ = false;        // gRPC has let go of this object; status_ is final
  absl::Status status_;
};

}  // namespace romap::client
