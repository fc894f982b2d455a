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

// The event queue of one subscriber. It never blocks the sender: events that a slow reader has not read yet are
// coalesced, so that only the newest cuboid and the newest mesh of each object wait. The order is kept, with these
// rules:
//   - The first update of an object, which announces it, keeps its position: no other event of the object precedes it.
//   - No event of an object follows its removal or merge.
//   - An object that is created and removed before its announcement is read produces no event at all. Objects whose
//     waiting merge refers to it are merged into the object that it was merged into, or removed if it was removed.
// A reader that applies all events has the same map as the sender. The number of waiting events is bounded by the
// number of current objects and of objects whose announcement was read.
//
// Required of the sender: the first event of an object is an ObjectUpdate; object ids are never reused; a merge is
// followed by an update of `into`, which gives the new revision to readers that do not receive the merge. Thread-safe.
class Outbox {
 public:
  enum class Acks {
    kAll,     // for the client that sends the frames
    kNewest,  // for viewers, which follow the camera: only the newest FrameAck waits, and no MasksAck
  };

  // `max_acks`: with kAll, at most this many acknowledgements wait; then the oldest is dropped.
  Outbox(Acks acks, size_t max_acks) : acks_(acks), max_acks_(max_acks) {}

  void Put(MapEvent event);
  // Waits for the next event; nullopt after `timeout`, or if the outbox is closed and empty.
  std::optional<MapEvent> Next(std::chrono::milliseconds timeout);

  // Ends Put(); waiting events can still be read. Only the first call sets the status.
  void Close(absl::Status status = absl::OkStatus());
  bool Done() const;  // closed and empty
  absl::Status status() const;

 private:
  using EventIterator = std::list<MapEvent>::iterator;
  // A current object that was announced, or whose announcement waits. Iterators of events that wait.
  struct AnnouncedObject {
    uint64_t revision = 0;  // of the last event
    std::optional<EventIterator> announcement, update, mesh;
  };
  struct WaitingMerge {
    EventIterator event;
    uint64_t removal_revision = 0;  // of `from`, should the merge become a removal
  };
  struct Putter;

  void PutAck(MapEvent event);
  void PutUpdate(ObjectUpdate update);
  void PutMesh(MeshUpdate mesh);
  void PutRemoved(ObjectRemoved removed);
  void PutMerged(ObjectMerged merged);
  // Drops the object and its waiting events. False if its announcement was not read: then the reader must not get its
  // removal either.
  bool DropObject(ObjectId id, uint64_t* last_revision);
  EventIterator Append(MapEvent event);
  void Replace(std::optional<EventIterator>& old_event, MapEvent event);
  void Drop(std::optional<EventIterator>& event);
  void ClearIteratorsToFront();
  void TrimAcks();

  const Acks acks_;
  const size_t max_acks_;
  mutable std::mutex mutex_;
  std::condition_variable ready_;
  std::list<MapEvent> events_;
  std::map<ObjectId, AnnouncedObject> objects_;
  std::map<ObjectId, WaitingMerge> merges_;  // by `from`
  std::optional<EventIterator> statistics_, durable_, newest_ack_;
  size_t waiting_acks_ = 0;
  bool closed_ = false;
  absl::Status status_;
};

}  // namespace romap::session
