#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <grpcpp/support/server_callback.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <utility>

#include "common/mapping_service.h"
#include "common/wire/events.h"
#include "common/wire/sessions.h"
#include "common/wire/status.h"
#include "server/transport/call_host.h"

namespace romap::transport {

// Waits for a gRPC operation that was started. One operation at a time.
class Completion {
 public:
  // Called by gRPC's thread when the operation ends.
  void Complete(bool ok) {
    std::lock_guard lock(mutex_);
    result_ = ok;
    changed_.notify_all();
  }
  // Waits for the operation and returns whether it succeeded; nullopt after Abandon().
  std::optional<bool> Wait() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return abandoned_ || result_.has_value(); });
    return abandoned_ ? std::nullopt : std::exchange(result_, std::nullopt);
  }
  // The same, but nullopt after `timeout` too.
  std::optional<bool> WaitFor(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, timeout, [&] { return abandoned_ || result_.has_value(); });
    return abandoned_ ? std::nullopt : std::exchange(result_, std::nullopt);
  }
  // Ends the current Wait() and all later ones.
  void Abandon() {
    std::lock_guard lock(mutex_);
    abandoned_ = true;
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<bool> result_;
  bool abandoned_ = false;
};

// A streaming call whose work is done by Run() on its own thread; gRPC's threads only report completed operations. Must
// be created with new; deletes itself when gRPC no longer needs it.
// Reactor: grpc::ServerWriteReactor<Response>, or a ServerBidiReactor that writes Response.
template <class Reactor, class Response>
class StreamReactor : public Reactor, public StoppableCall {
 public:
  // `caller`: an error ends the call.
  StreamReactor(CallHost* host, absl::StatusOr<access::Caller> caller) : host_(host), caller_(std::move(caller)) {}

  // Call once, after construction.
  void Start() {
    if (!caller_.ok()) return this->Finish(wire::ToGrpc(caller_.status()));
    const absl::Status launched = host_->Launch(this, [this] {
      absl::Status status = Guarded([this] { return Run(); });
      // gRPC may delete this object after Finish().
      this->Finish(wire::ToGrpc(StopReasonOr(std::move(status))));
    });
    if (!launched.ok()) this->Finish(wire::ToGrpc(launched));
  }

  void OnWriteDone(bool ok) final { write_.Complete(ok); }
  void OnCancel() final { RequestStop(absl::CancelledError("the client disconnected")); }
  void OnDone() final {
    host_->Unregister(this);
    delete this;
  }

  void RequestStop(const absl::Status& reason) final {
    std::lock_guard lock(mutex_);
    if (stop_reason_) return;
    stop_reason_ = reason;
    if (events_ != nullptr) events_->Cancel();
    OnStop();
  }

 protected:
  // Processes the whole call, from the first request to the last response, and returns its status. May block, but must
  // return soon after RequestStop().
  virtual absl::Status Run() = 0;
  // Ends waits that EventStream::Cancel() does not end. Must not block.
  virtual void OnStop() {}

  MappingService& service() const { return *caller_->service; }

  bool stopping() {
    std::lock_guard lock(mutex_);
    return stop_reason_.has_value();
  }

  // Waits until gRPC has accepted the message; false if the client disconnected. Any thread of this call may write.
  bool Write(const Response& response) {
    std::lock_guard lock(write_mutex_);
    this->StartWrite(&response);
    return write_.Wait().value_or(false);
  }

  // Writes `opened`, then events until either side ends the stream. Meanwhile, RequestStop() cancels `events`.
  absl::Status ForwardEvents(const std::string& session_id, EventStream& events) {
    // RequestStop() wakes Next() earlier.
    constexpr std::chrono::milliseconds kLongWait{1000};
    if (!Attach(&events)) return absl::CancelledError("stopped before the stream was open");
    Response opened;
    *opened.mutable_opened() = wire::ToProto(session_id, events.opening());
    bool writable = Write(opened);
    auto next_check = std::chrono::steady_clock::now() + kCheckPeriod;
    while (writable && !stopping()) {
      if (std::chrono::steady_clock::now() > next_check) {
        next_check += kCheckPeriod;
        if (!caller_->is_valid()) RequestStop(absl::UnauthenticatedError("the token is not valid any longer"));
      }
      std::optional<MapEvent> event = events.Next(kLongWait);
      if (event) {
        Response response;
        *response.mutable_event() = wire::ToProto(*std::move(event));
        writable = Write(response);
      } else if (events.Done()) {
        break;
      }
    }
    Detach();
    return writable ? events.status() : absl::CancelledError("the client disconnected");
  }

 private:
  bool Attach(EventStream* events) {
    std::lock_guard lock(mutex_);
    if (stop_reason_) return false;
    events_ = events;
    return true;
  }
  void Detach() {
    std::lock_guard lock(mutex_);
    events_ = nullptr;
  }
  absl::Status StopReasonOr(absl::Status status) {
    std::lock_guard lock(mutex_);
    return stop_reason_.value_or(std::move(status));
  }

  static constexpr std::chrono::seconds kCheckPeriod{2};  // of the caller's token

  CallHost* const host_;
  const absl::StatusOr<access::Caller> caller_;
  std::mutex write_mutex_;
  Completion write_;

  std::mutex mutex_;
  std::optional<absl::Status> stop_reason_;  // nullopt until RequestStop()
  EventStream* events_ = nullptr;
};

}  // namespace romap::transport
