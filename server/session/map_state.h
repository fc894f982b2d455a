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
#include "common/stage_messages.h"
#include "server/session/mesh_pose.h"
#include "server/session/outbox.h"
#include "server/session/trajectory.h"

namespace romap::session {

// The map that clients see: the newest cuboid and mesh of every object, the trajectory, and the subscribers. Only this
// class assigns revisions: every change of an object gets the next one and is sent to all outboxes. A correction moves
// existing meshes by their pose; their vertices are not sent again. The id of a removed object is never used again.
// Thread-safe.
//
// After a restart of the server there are two for a while: the stored one serves clients, while the session makes its
// map again from the stored inputs in another one, which then takes the place of the stored one.
class MapState {
 public:
  // Applies an ObjectUpdate, ObjectRemoved or ObjectMerged; its revision is overwritten. Ignored if the object was
  // removed or, for removals and merges, if no update of it came before. A merge into an unknown object becomes a
  // removal.
  void Apply(MapEvent event);
  // Moves the mesh of an object with the space around it: p_new = S_new_old * p_old. Later meshes of older snapshots
  // are moved too. Clients get the new pose with the object's next update, so call this before Apply() of the
  // updates of the same correction. Also call it before the correction is passed to the field: snapshots must not
  // include corrections that were not applied here.
  void MoveObject(ObjectId object, const Sim3<World, World>& S_new_old);
  // Ignored if the object was removed.
  void PublishMesh(MeshUpdate mesh, const MeshPose& pose);
  // Sends the acknowledgement, and adds an accepted frame with a pose to the trajectory. See TrackedFrame for
  // `reference`, `T_reference_camera` and its uncertainty.
  void Acknowledge(FrameAck ack, int64_t timestamp_ns, KeyframeId reference = {},
                   const SE3<Camera, Camera>& T_reference_camera = {},
                   const PoseUncertainty& reference_uncertainty = {});
  // A frame became a keyframe, with this pose.
  void SetKeyframe(uint64_t frame_id, int64_t timestamp_ns, KeyframeId keyframe,
                   const SE3<World, Camera>& T_world_camera);
  // Moves the frames of the trajectory with their corrected keyframes, whose uncertainties they take over, and to the
  // maps that theirs were merged into.
  void Correct(const MapCorrection& correction);
  void Acknowledge(MasksAck ack);
  void Publish(const Statistics& statistics);
  void Publish(const Diagnostic& diagnostic);
  void Publish(const Durable& durable);

  // A new map begins with stored objects and trajectory. `last_object`: the largest id that was ever used.
  void Load(std::vector<ObjectSnapshot> objects, std::vector<FrameAck> trajectory, std::vector<int64_t> timestamps_ns,
            ObjectId last_object);
  // This map was made again from the inputs of `stored`. Its objects get the ids that they have there, and new ids
  // otherwise, also in all later events. Their stored meshes are kept until the training has made better ones. The
  // subscribers of `stored` become those of this map and get the differences; `stored` is closed.
  void Replace(MapState& stored);

  // The outbox starts with the current objects, whose ids are stored in `objects` if it is not null. It is closed if
  // the map is closed.
  std::shared_ptr<Outbox> Subscribe(Outbox::Acks acks, size_t max_acks, std::vector<ObjectId>* objects = nullptr);
  void Unsubscribe(const std::shared_ptr<Outbox>& outbox);
  // Ends all present and future subscriptions.
  void Close(const absl::Status& status);

  // Objects, trajectory and timestamps. The caller sets the other fields.
  MapSnapshot Snapshot() const;
  uint64_t ConfirmedObjects() const;
  size_t Subscribers() const;
  size_t TrackedFrames() const;  // length of the trajectory
  void CopyTrajectory(std::vector<FrameAck>* trajectory, std::vector<int64_t>* timestamps_ns) const;

 private:
  struct Object {
    ObjectUpdate object;
    std::optional<MeshUpdate> mesh;
    Sim3<World, World> S_new_first;  // product of all corrections of its space
    uint64_t stored_steps = 0;       // > 0: a stored mesh, which is better than one with fewer steps
  };
  struct TrackedAck {
    FrameAck ack;
    int64_t timestamp_ns = 0;
  };

  void Send(const MapEvent& event);
  void ApplyUpdate(ObjectUpdate update);
  void ApplyRemoval(ObjectRemoved removed);
  void ApplyMerge(ObjectMerged merged);
  SparseMapId CurrentMap(SparseMapId map) const;
  void CopyTrajectoryLocked(std::vector<FrameAck>* trajectory, std::vector<int64_t>* timestamps_ns) const;
  ObjectId PublicId(ObjectId id);
  void TakeOver(MapState& stored, ObjectId id, Object& entry);

  mutable std::mutex mutex_;
  std::map<ObjectId, Object> objects_;  // by the id that clients know
  std::set<ObjectId> removed_;          // ids of the mapper
  // After Replace(): the ids that clients know, by those of the mapper. nullopt: they are the same.
  std::optional<std::map<ObjectId, ObjectId>> public_ids_;
  ObjectId last_object_;
  std::vector<TrackedAck> tracked_;                 // accepted frames with a pose
  Trajectory trajectory_;                           // of the same frames
  std::map<SparseMapId, SparseMapId> merged_maps_;  // each into which one
  std::optional<Durable> durable_;
  std::vector<std::shared_ptr<Outbox>> outboxes_;
  std::optional<absl::Status> closed_;
};

}  // namespace romap::session
