#include "server/session/map_state.h"

#include <algorithm>
#include <utility>

#include "server/session/restored_objects.h"

namespace romap::session {

void MapState::Send(const MapEvent& event) {
  for (const auto& outbox : outboxes_) outbox->Put(event);
}

void MapState::Apply(MapEvent event) {
  std::lock_guard lock(mutex_);
  if (auto* update = std::get_if<ObjectUpdate>(&event)) {
    ApplyUpdate(std::move(*update));
  } else if (auto* removed = std::get_if<ObjectRemoved>(&event)) {
    ApplyRemoval(std::move(*removed));
  } else if (auto* merged = std::get_if<ObjectMerged>(&event)) {
    ApplyMerge(*merged);
  }
}

// Ids of removed objects have no public id any longer, so check removed_ first.
ObjectId MapState::PublicId(ObjectId id) {
  if (!public_ids_) {
    last_object_ = std::max(last_object_, id);
    return id;
  }
  const auto [it, is_new] = public_ids_->try_emplace(id);
  if (is_new) it->second = last_object_ = ObjectId{last_object_.value + 1};
  return it->second;
}

void MapState::ApplyUpdate(ObjectUpdate update) {
  if (removed_.contains(update.id)) return;
  update.id = PublicId(update.id);
  Object& entry = objects_[update.id];
  update.revision = entry.object.revision + 1;
  update.T_world_mesh = entry.object.T_world_mesh;
  update.mesh_scale = entry.object.mesh_scale;
  entry.object = std::move(update);
  Send(entry.object);
}

void MapState::ApplyRemoval(ObjectRemoved removed) {
  if (removed_.contains(removed.id)) return;
  const ObjectId id = removed.id;
  removed.id = PublicId(id);
  const auto it = objects_.find(removed.id);
  if (it == objects_.end()) return;
  removed.revision = it->second.object.revision + 1;
  removed_.insert(id);
  objects_.erase(it);
  Send(removed);
}

void MapState::ApplyMerge(ObjectMerged merged) {
  if (merged.from == merged.into || removed_.contains(merged.from)) return;
  const auto into = removed_.contains(merged.into) ? objects_.end() : objects_.find(PublicId(merged.into));
  if (into == objects_.end()) {
    return ApplyRemoval({.id = merged.from, .revision = 0, .reason = "merged into " + merged.into.ToString()});
  }
  const ObjectId from = merged.from;
  merged.from = PublicId(from);
  merged.into = into->first;
  if (objects_.erase(merged.from) == 0) return;
  removed_.insert(from);
  ObjectUpdate& object = into->second.object;
  merged.revision = ++object.revision;
  Send(merged);
  // A slow reader may miss the merge but must get the revision.
  ++object.revision;
  Send(object);
}

void MapState::MoveObject(ObjectId object, const Sim3<World, World>& S_new_old) {
  std::lock_guard lock(mutex_);
  if (removed_.contains(object)) return;
  const auto it = objects_.find(PublicId(object));
  if (it == objects_.end()) return;
  Object& entry = it->second;
  entry.S_new_first = S_new_old * entry.S_new_first;
  if (!entry.object.T_world_mesh) return;
  entry.object.T_world_mesh = S_new_old.Moved(*entry.object.T_world_mesh);
  entry.object.mesh_scale *= S_new_old.scale();
}

void MapState::PublishMesh(MeshUpdate mesh, const MeshPose& pose) {
  std::lock_guard lock(mutex_);
  if (removed_.contains(mesh.id)) return;
  mesh.id = PublicId(mesh.id);
  const auto it = objects_.find(mesh.id);
  if (it == objects_.end()) return;
  Object& entry = it->second;
  if (mesh.steps < entry.stored_steps && !mesh.final) return;
  entry.stored_steps = 0;
  mesh.revision = ++entry.object.revision;
  entry.mesh = std::move(mesh);
  Send(*entry.mesh);
  // The pose of the mesh is part of the object update. The snapshot may lack the newest corrections.
  const Sim3<World, World> S_new_snapshot = entry.S_new_first * pose.S_new_first.Inverse();
  entry.object.T_world_mesh = S_new_snapshot.Moved(pose.T_world_mesh);
  entry.object.mesh_scale = S_new_snapshot.scale();
  ++entry.object.revision;
  Send(entry.object);
}

void MapState::Acknowledge(FrameAck ack, int64_t timestamp_ns, KeyframeId reference,
                           const SE3<Camera, Camera>& T_reference_camera,
                           const PoseUncertainty& reference_uncertainty) {
  std::lock_guard lock(mutex_);
  if (ack.accepted && ack.T_world_camera) {
    trajectory_.Add({.frame_id = ack.frame_id,
                     .timestamp_ns = timestamp_ns,
                     .T_world_camera = *ack.T_world_camera,
                     .reference = reference,
                     .T_reference_camera = T_reference_camera,
                     .uncertainty = ack.uncertainty,
                     .reference_uncertainty = reference_uncertainty});
    tracked_.push_back({ack, timestamp_ns});
  }
  Send(ack);
}

void MapState::SetKeyframe(uint64_t frame_id, int64_t timestamp_ns, KeyframeId keyframe,
                           const SE3<World, Camera>& T_world_camera) {
  std::lock_guard lock(mutex_);
  trajectory_.SetKeyframe(frame_id, timestamp_ns, keyframe, T_world_camera);
}

SparseMapId MapState::CurrentMap(SparseMapId map) const {
  for (auto it = merged_maps_.find(map); it != merged_maps_.end(); it = merged_maps_.find(map)) map = it->second;
  return map;
}

void MapState::Correct(const MapCorrection& correction) {
  std::lock_guard lock(mutex_);
  trajectory_.Correct(correction);
  for (const MapMerge& merge : correction.merged_maps) merged_maps_[merge.from] = merge.into;
}

void MapState::Acknowledge(MasksAck ack) {
  std::lock_guard lock(mutex_);
  Send(ack);
}

void MapState::Publish(const Statistics& statistics) {
  std::lock_guard lock(mutex_);
  Send(statistics);
}

void MapState::Publish(const Diagnostic& diagnostic) {
  std::lock_guard lock(mutex_);
  Send(diagnostic);
}

void MapState::Publish(const Durable& durable) {
  std::lock_guard lock(mutex_);
  durable_ = durable;
  Send(durable);
}

void MapState::Load(std::vector<ObjectSnapshot> objects, std::vector<FrameAck> trajectory,
                    std::vector<int64_t> timestamps_ns, ObjectId last_object) {
  std::lock_guard lock(mutex_);
  last_object_ = last_object;
  for (ObjectSnapshot& snapshot : objects) {
    const ObjectId id = snapshot.object.id;
    last_object_ = std::max(last_object_, id);
    objects_[id] = {.object = std::move(snapshot.object), .mesh = std::move(snapshot.mesh), .S_new_first = {}};
  }
  for (size_t i = 0; i < trajectory.size(); ++i) {
    trajectory_.Add({.frame_id = trajectory[i].frame_id,
                     .timestamp_ns = timestamps_ns[i],
                     .T_world_camera = *trajectory[i].T_world_camera,
                     .uncertainty = trajectory[i].uncertainty});
    tracked_.push_back({std::move(trajectory[i]), timestamps_ns[i]});
  }
}

void MapState::Replace(MapState& stored) {
  std::scoped_lock lock(mutex_, stored.mutex_);
  std::vector<ObjectUpdate> before, made_again;
  for (const auto& [id, entry] : stored.objects_) before.push_back(entry.object);
  for (const auto& [id, entry] : objects_) made_again.push_back(entry.object);
  public_ids_ = FindRestoredObjects(before, made_again);
  last_object_ = stored.last_object_;
  outboxes_.insert(outboxes_.end(), stored.outboxes_.begin(), stored.outboxes_.end());
  std::map<ObjectId, Object> objects;
  for (auto& [id, entry] : objects_) {
    const ObjectId public_id = PublicId(id);
    entry.object.id = public_id;
    if (entry.mesh) entry.mesh->id = public_id;
    objects[public_id] = std::move(entry);
  }
  objects_ = std::move(objects);
  for (const ObjectUpdate& object : before) {
    if (objects_.contains(object.id)) continue;
    Send(ObjectRemoved{
        .id = object.id, .revision = object.revision + 1, .reason = "not found again when the session was restored"});
  }
  for (auto& [id, entry] : objects_) TakeOver(stored, id, entry);
  if (closed_) {
    for (const auto& outbox : outboxes_) outbox->Close(*closed_);
    outboxes_.clear();
  }
  stored.outboxes_.clear();
  stored.closed_ = absl::UnavailableError("the session was restored; open the stream again");
}

// Continues the revisions of the stored object, if there is one, and keeps its mesh unless the new one is better.
void MapState::TakeOver(MapState& stored, ObjectId id, Object& entry) {
  bool is_new_mesh = entry.mesh.has_value();
  if (const auto it = stored.objects_.find(id); it != stored.objects_.end()) {
    Object& old = it->second;
    entry.object.revision = std::max(entry.object.revision, old.object.revision);
    const bool is_better = entry.mesh && old.mesh && (entry.mesh->final || entry.mesh->steps >= old.mesh->steps);
    if (old.mesh && !is_better) {
      entry.stored_steps = old.mesh->steps;
      entry.mesh = std::move(old.mesh);
      entry.object.T_world_mesh = old.object.T_world_mesh;
      entry.object.mesh_scale = old.object.mesh_scale;
      is_new_mesh = false;
    }
  }
  ++entry.object.revision;
  Send(entry.object);
  if (!is_new_mesh) return;
  entry.mesh->revision = ++entry.object.revision;
  Send(*entry.mesh);
  ++entry.object.revision;
  Send(entry.object);
}

std::shared_ptr<Outbox> MapState::Subscribe(Outbox::Acks acks, size_t max_acks, std::vector<ObjectId>* objects) {
  auto outbox = std::make_shared<Outbox>(acks, max_acks);
  std::lock_guard lock(mutex_);
  if (durable_) outbox->Put(*durable_);
  for (const auto& [id, entry] : objects_) {
    if (objects != nullptr) objects->push_back(id);
    outbox->Put(entry.object);
    if (entry.mesh) outbox->Put(*entry.mesh);
  }
  if (closed_) {
    outbox->Close(*closed_);
  } else {
    outboxes_.push_back(outbox);
  }
  return outbox;
}

void MapState::Unsubscribe(const std::shared_ptr<Outbox>& outbox) {
  std::lock_guard lock(mutex_);
  std::erase(outboxes_, outbox);
}

void MapState::Close(const absl::Status& status) {
  std::lock_guard lock(mutex_);
  if (closed_) return;
  closed_ = status;
  for (const auto& outbox : outboxes_) outbox->Close(status);
  outboxes_.clear();
}

MapSnapshot MapState::Snapshot() const {
  std::lock_guard lock(mutex_);
  MapSnapshot snapshot;
  for (const auto& [id, entry] : objects_) {
    if (entry.object.state != ObjectState::kProvisional) {
      snapshot.objects.push_back({entry.object, entry.mesh});
    }
  }
  CopyTrajectoryLocked(&snapshot.trajectory, &snapshot.timestamps_ns);
  return snapshot;
}

void MapState::CopyTrajectory(std::vector<FrameAck>* trajectory, std::vector<int64_t>* timestamps_ns) const {
  std::lock_guard lock(mutex_);
  CopyTrajectoryLocked(trajectory, timestamps_ns);
}

void MapState::CopyTrajectoryLocked(std::vector<FrameAck>* trajectory, std::vector<int64_t>* timestamps_ns) const {
  const std::vector<SE3<World, Camera>> poses = trajectory_.Poses();
  const std::vector<std::optional<PoseUncertainty>> uncertainties = trajectory_.Uncertainties();
  for (size_t i = 0; i < tracked_.size(); ++i) {
    FrameAck& ack = trajectory->emplace_back(tracked_[i].ack);
    ack.T_world_camera = poses[i];
    ack.uncertainty = uncertainties[i];
    ack.map_id = CurrentMap(tracked_[i].ack.map_id);
    timestamps_ns->push_back(tracked_[i].timestamp_ns);
  }
}

size_t MapState::Subscribers() const {
  std::lock_guard lock(mutex_);
  return outboxes_.size();
}

size_t MapState::TrackedFrames() const {
  std::lock_guard lock(mutex_);
  return tracked_.size();
}

uint64_t MapState::ConfirmedObjects() const {
  std::lock_guard lock(mutex_);
  return std::count_if(objects_.begin(), objects_.end(),
                       [](const auto& entry) { return entry.second.object.state != ObjectState::kProvisional; });
}

}  // namespace romap::session
