#include "server/session/map_state.h"

#include <algorithm>
#include <utility>

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

void MapState::ApplyUpdate(ObjectUpdate update) {
  if (removed_.contains(update.id)) return;
  Object& entry = objects_[update.id];
  update.revision = entry.object.revision + 1;
  update.T_world_mesh = entry.object.T_world_mesh;
  update.mesh_scale = entry.object.mesh_scale;
  entry.object = std::move(update);
  Send(entry.object);
}

void MapState::ApplyRemoval(ObjectRemoved removed) {
  const auto it = objects_.find(removed.id);
  if (it == objects_.end()) return;
  removed.revision = it->second.object.revision + 1;
  removed_.insert(removed.id);
  objects_.erase(it);
  Send(removed);
}

void MapState::ApplyMerge(ObjectMerged merged) {
  if (merged.from == merged.into) return;
  const auto into = objects_.find(merged.into);
  if (into == objects_.end()) {
    return ApplyRemoval({.id = merged.from, .revision = 0, .reason = "merged into " + merged.into.ToString()});
  }
  if (objects_.erase(merged.from) == 0) return;
  removed_.insert(merged.from);
  ObjectUpdate& object = into->second.object;
  merged.revision = ++object.revision;
  Send(merged);
  // A slow reader may miss the merge but must get the revision.
  ++object.revision;
  Send(object);
}

void MapState::MoveObject(ObjectId object, const Sim3<World, World>& S_new_old) {
  std::lock_guard lock(mutex_);
  const auto it = objects_.find(object);
  if (it == objects_.end()) return;
  Object& entry = it->second;
  entry.S_new_first = S_new_old * entry.S_new_first;
  if (!entry.object.T_world_mesh) return;
  entry.object.T_world_mesh = S_new_old.Moved(*entry.object.T_world_mesh);
  entry.object.mesh_scale *= S_new_old.scale();
}

void MapState::PublishMesh(MeshUpdate mesh, const MeshPose& pose) {
  std::lock_guard lock(mutex_);
  const auto it = objects_.find(mesh.id);
  if (it == objects_.end()) return;
  Object& entry = it->second;
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
  const std::vector<SE3<World, Camera>> poses = trajectory_.Poses();
  const std::vector<std::optional<PoseUncertainty>> uncertainties = trajectory_.Uncertainties();
  for (size_t i = 0; i < tracked_.size(); ++i) {
    snapshot.trajectory.push_back(tracked_[i].ack);
    snapshot.trajectory.back().T_world_camera = poses[i];
    snapshot.trajectory.back().uncertainty = uncertainties[i];
    snapshot.trajectory.back().map_id = CurrentMap(tracked_[i].ack.map_id);
    snapshot.timestamps_ns.push_back(tracked_[i].timestamp_ns);
  }
  return snapshot;
}

uint64_t MapState::ConfirmedObjects() const {
  std::lock_guard lock(mutex_);
  return std::count_if(objects_.begin(), objects_.end(),
                       [](const auto& entry) { return entry.second.object.state != ObjectState::kProvisional; });
}

}  // namespace romap::session
