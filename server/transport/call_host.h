#pragma once

#include <absl/status/status.h>

#include <functional>
#include <list>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include "common/mapping_service.h"

namespace romap::transport {

// A call that lives until it is told to stop.
class StoppableCall {
 public:
  virtual ~StoppableCall() = default;
  // Makes the call end soon, with `why` (which may be OK) as its status. Does not wait. The first reason counts.
  virtual void RequestStop(const absl::Status& why) = 0;
};

// What all calls of one server share. Each call has a thread of its own, because whatever MappingService does may wait
// and gRPC's threads must not. Thread-safe.
class CallHost {
 public:
  CallHost(MappingService* service, int max_calls) : service_(service), max_calls_(max_calls) {}
  ~CallHost() { JoinAll(); }

  MappingService& service() const { return *service_; }

  // Runs `body` on a thread of its own and lets StopAll() reach `call` (may be null) until Forget(call).
  // RESOURCE_EXHAUSTED: too many calls. After StopAll(): its status.
  absl::Status Launch(StoppableCall* call, std::function<void()> body);
  void Forget(StoppableCall* call);

  // Stops every registered call and refuses new ones.
  void StopAll(const absl::Status& why);
  // Waits for every body to return.
  void JoinAll();

 private:
  using Threads = std::list<std::thread>;

  Threads TakeEnded();

  MappingService* const service_;
  const size_t max_calls_;

  std::mutex mutex_;
  absl::Status stopped_;  // OK while calls are taken
  std::set<StoppableCall*> calls_;
  Threads threads_;
  std::vector<Threads::iterator> ended_;  // their bodies have returned
};

// Runs `body`, which returns an absl::Status, and turns an exception into INTERNAL: a bug in one call must not take the
// server down.
absl::Status Guarded(const std::function<absl::Status()>& body);

}  // namespace romap::transport
