#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <mutex>
#include <optional>

#include "common/map_events.h"

namespace romap::session {

// Events on their way to one subscriber. Never blocks the sender: what a slow reader has not taken yet is coalesced, so
// that per object only the newest cuboid and the newest mesh wait. Order is kept otherwise, and
//   - the first update of an object, which announces it, stays where it is: nothing is said of an object before it;
//   - after the removal or merge of an object nothing is said of it;
//   - an object that came and went before the reader heard of it is passed over in silence. What was merged into it
//   then
//     has gone where it went.
// So whoever applies what is read has, when all is read, what the sender has; and what waits is bounded by the objects
// that are there and those the reader has heard of. An object must be put first by an ObjectUpdate, its id is not used
// again, and after a merge an update of `into` must follow: it brings the revision where the merge is passed over.
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
  using Place = std::list<MapEvent>::iterator;
  // An object that is there, as far as the reader knows or will know. Places are those of events that wait.
  struct Known {
    uint64_t revision = 0;  // the last that was put
    std::optional<Place> announcement, update, mesh;
  };
  struct WaitingMerge {
    Place place;
    uint64_t removal_revision = 0;  // of the object that was merged away, were it removed instead
  };
  struct Putter;

  void PutAck(MapEvent event);
  void PutUpdate(ObjectUpdate update);
  void PutMesh(MeshUpdate mesh);
  void PutRemoved(ObjectRemoved removed);
  void PutMerged(ObjectMerged merged);
  // Forgets the object and what waits of it. False when the reader has not heard of it, and so need not of its end.
  bool ForgetObject(ObjectId id, uint64_t* last_revision);
  Place Append(MapEvent event);
  void Replace(std::optional<Place>& place, MapEvent event);
  void Drop(std::optional<Place>& place);
  void ForgetFront();
  void TrimAcks();

  const Acks acks_;
  const size_t max_acks_;
  mutable std::mutex mutex_;
  std::condition_variable ready_;
  std::list<MapEvent> events_;
  std::map<ObjectId, Known> known_;
  std::map<ObjectId, WaitingMerge> merges_;  // that wait, by the object that was merged away
  std::optional<Place> statistics_, newest_ack_;
  size_t waiting_acks_ = 0;
  bool closed_ = false;
  absl::Status status_;
};

}  // namespace romap::session
