#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <list>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

#include "common/messages.h"

namespace romap {

// Events on their way to one subscriber. Never blocks the sender: what a slow reader has not taken yet is coalesced, so
// that per object only the newest cuboid and the newest mesh wait. Order is kept otherwise.
class Outbox {
 public:
  enum class Acks { kAll /* the client that sends the frames */, kNewest /* a viewer that follows the camera */ };

  Outbox(Acks acks, size_t max_acks) : acks_(acks), max_acks_(max_acks) {}

  void Put(MapEvent event);
  std::optional<MapEvent> Next(std::chrono::milliseconds timeout);

  // No more events; what waits can still be taken. The first call decides the status.
  void Close(absl::Status status = absl::OkStatus());
  bool Done() const;  // closed and empty
  absl::Status status() const;

 private:
  using Key = std::pair<size_t, uint64_t>;  // index in the MapEvent variant, object

  void Append(const Key& key, MapEvent event);
  void Forget(const Key& key);
  void TrimAcks();

  const Acks acks_;
  const size_t max_acks_;
  mutable std::mutex mutex_;
  std::condition_variable ready_;
  std::list<MapEvent> events_;
  std::map<Key, std::list<MapEvent>::iterator> waiting_;  // events that a newer one replaces
  size_t waiting_acks_ = 0;
  bool closed_ = false;
  absl::Status status_;
};

}  // namespace romap
