#pragma once

#include <absl/status/status.h>

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "common/mapping_service.h"
#include "common/messages.h"
#include "server/session/outbox.h"

namespace romap {

// The map as clients see it: the newest cuboid and mesh of every object, the trajectory, and who listens. Every change
// gets its revision here and goes to all outboxes. Thread-safe.
class MapState {
 public:
  // What the objects stage says: updates, removals, merges.
  void Apply(MapEvent event);
  // A new mesh and the pose of the frame its vertices are in. Ignored when its object is gone.
  void PublishMesh(MeshUpdate mesh, const SE3<World, Object>& T_world_mesh);
  // Answer to one frame; kept in the trajectory when it has a pose.
  void Acknowledge(FrameAck ack, int64_t timestamp_ns);
  void Publish(const Statistics& statistics);

  // Starts with the objects there are, if `with_snapshot`. Already closed when the map is.
  std::shared_ptr<Outbox> Subscribe(Outbox::Acks acks, size_t max_acks, bool with_snapshot);
  void Unsubscribe(const std::shared_ptr<Outbox>& outbox);
  // Ends all present and future subscriptions.
  void Close(const absl::Status& status);

  // Objects, trajectory and timestamps; the rest is the session's to fill in.
  MapSnapshot Snapshot() const;
  uint64_t ConfirmedObjects() const;

 private:
  void Send(const MapEvent& event);
  void ApplyUpdate(ObjectUpdate update);
  uint64_t Forget(ObjectId id);

  mutable std::mutex mutex_;
  std::map<ObjectId, ObjectSnapshot> objects_;
  std::vector<FrameAck> trajectory_;
  std::vector<int64_t> timestamps_ns_;
  std::vector<std::shared_ptr<Outbox>> outboxes_;
  std::optional<absl::Status> closed_;
};

}  // namespace romap
