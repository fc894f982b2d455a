#pragma once

#include <absl/status/status.h>

#include <functional>
#include <list>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include "server/access/authenticator.h"

namespace romap::transport {

// A call that can be ended by the server.
class StoppableCall {
 public:
  virtual ~StoppableCall() = default;
  // Ends the call soon, with `reason` (which may be OK) as its status. Does not wait. Only the first call has an
  // effect.
  virtual void RequestStop(const absl::Status& reason) = 0;
};

// Runs the calls of one server. Every call has its own thread, because the methods of MappingService may block and
// gRPC's threads must not. Thread-safe.
class CallHost {
 public:
  // `authenticator` outlives the host.
  CallHost(const access::Authenticator* authenticator, int max_calls)
      : authenticator_(*authenticator), max_calls_(max_calls) {}
  ~CallHost() { JoinAll(); }

  const access::Authenticator& authenticator() const { return authenticator_; }

  // Runs `body` on a new thread. StopAll() stops `call`, which may be null, until Unregister(call). RESOURCE_EXHAUSTED:
  // too many calls. After StopAll(): the status given there.
  absl::Status Launch(StoppableCall* call, std::function<void()> body);
  void Unregister(StoppableCall* call);

  // Stops all registered calls and rejects new ones.
  void StopAll(const absl::Status& reason);
  // Waits for every body to return.
  void JoinAll();

 private:
  using Threads = std::list<std::thread>;

  Threads TakeEnded();

  const access::Authenticator& authenticator_;
  const size_t max_calls_;

  std::mutex mutex_;
  absl::Status stopped_;  // OK before StopAll()
  std::set<StoppableCall*> calls_;
  Threads threads_;
  std::vector<Threads::iterator> ended_;  // those whose body has returned
};

// Runs `body` and converts an exception to INTERNAL, so that a fault in one call does not terminate the server.
absl::Status Guarded(const std::function<absl::Status()>& body);

}  // namespace romap::transport
