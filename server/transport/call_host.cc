#include "server/transport/call_host.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <system_error>
#include <utility>

#include "common/status.h"

namespace romap::transport {

absl::Status CallHost::Launch(StoppableCall* call, std::function<void()> body) {
  Threads ended;
  {
    std::lock_guard lock(mutex_);
    if (!stopped_.ok()) return stopped_;
    ended = TakeEnded();
    if (threads_.size() >= max_calls_) {
      return absl::ResourceExhaustedError(
          fmt::format("the limit of {} concurrent calls (transport.max_calls) is reached", max_calls_));
    }
    const auto self = threads_.emplace(threads_.end());
    try {
      *self = std::thread([this, self, body = std::move(body)] {
        body();
        std::lock_guard ending(mutex_);
        ended_.push_back(self);
      });
    } catch (const std::system_error& e) {
      threads_.erase(self);
      return absl::ResourceExhaustedError(fmt::format("cannot start a thread for this call: {}", e.what()));
    }
    if (call != nullptr) calls_.insert(call);
  }
  for (std::thread& thread : ended) thread.join();
  return absl::OkStatus();
}

void CallHost::Unregister(StoppableCall* call) {
  std::lock_guard lock(mutex_);
  calls_.erase(call);
}

void CallHost::StopAll(const absl::Status& reason) {
  std::lock_guard lock(mutex_);
  stopped_ = reason;
  for (StoppableCall* call : calls_) call->RequestStop(reason);
}

void CallHost::JoinAll() {
  Threads threads;
  {
    // The iterators in ended_ stay valid and are not used again.
    std::lock_guard lock(mutex_);
    threads = std::move(threads_);
  }
  for (std::thread& thread : threads) thread.join();
  std::lock_guard lock(mutex_);
  ended_.clear();
}

CallHost::Threads CallHost::TakeEnded() {
  Threads ended;
  for (const Threads::iterator thread : ended_) ended.splice(ended.end(), threads_, thread);
  ended_.clear();
  return ended;
}

absl::Status Guarded(const std::function<absl::Status()>& body) {
  try {
    return body();
  } catch (const std::exception& e) {
    spdlog::error("call failed: {}", e.what());
    return Internal("call failed: {}", e.what());
  }
}

}  // namespace romap::transport
