#pragma once

#include <absl/status/status.h>

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <vector>

#include "common/map_events.h"
#include "common/mapping_service.h"
#include "common/scaled_pose.h"
#include "common/stage_messages.h"
#include "server/session/mesh_place.h"
#include "server/session/outbox.h"

namespace romap::session {

// The map as clients see it: the newest cuboid and mesh of every object, the trajectory, and who listens. Every change
// gets its revision here and goes to all outboxes. Corrections move meshes and frames that are there already; the mesh
// itself is never sent again for it. What is gone stays gone: its id is never used again. Thread-safe.
class MapState {
 public:
  // What the objects stage says: updates, removals, merges. Passed over when it is about objects that are gone, or that
  // were never told of; an object that is merged into such a one is removed.
  void Apply(MapEvent event);
  // The space of an object underwent `S_new_old`: its mesh goes along, and so will meshes that are being made of older
  // snapshots. Clients learn of it by the object's next update, so call it before Apply() of what the same correction
  // changed, and before the field is told, which must never be ahead of the map.
  void MoveObject(ObjectId object, const Sim3<World, World>& S_new_old);
  // A new mesh, and where it stood when its snapshot was taken. Ignored when its object is gone.
  void PublishMesh(MeshUpdate mesh, const MeshPlace& place);
  // Answer to one frame; kept in the trajectory when it has a pose. See TrackedFrame for `reference`.
  void Acknowledge(FrameAck ack, int64_t timestamp_ns, KeyframeId reference = {},
                   const SE3<Camera, Camera>& T_reference_camera = {});
  // Keyframes were corrected: the frames of the trajectory that hang on them go along.
  void Correct(const MapCorrection& correction);
  // Answer to late masks.
  void Acknowledge(MasksAck ack);
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
  struct Object {
    ObjectUpdate object;
    std::optional<MeshUpdate> mesh;
    Sim3<World, World> S_new_first;  // all that corrections did to its space
  };
  struct TrajectoryEntry {
    FrameAck ack;
    int64_t timestamp_ns = 0;
    KeyframeId reference;
    SE3<Camera, Camera> T_reference_camera;
  };

  void Send(const MapEvent& event);
  void ApplyUpdate(ObjectUpdate update);
  void ApplyRemoval(ObjectRemoved removed);
  void ApplyMerge(ObjectMerged merged);
  SE3<World, Camera> PoseNow(const TrajectoryEntry& entry) const;

  mutable std::mutex mutex_;
  std::map<ObjectId, Object> objects_;
  std::set<ObjectId> gone_;
  std::vector<TrajectoryEntry> trajectory_;
  std::map<KeyframeId, ScaledPose> references_;
  std::vector<std::shared_ptr<Outbox>> outboxes_;
  std::optional<absl::Status> closed_;
};

}  // namespace romap::session
