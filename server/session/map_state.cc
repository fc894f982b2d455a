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
    if (reference) references_.try_emplace(reference, ScaledPose{*ack.T_world_camera * T_reference_camera.Inverse()});
    trajectory_.push_back({ack, timestamp_ns, reference, T_reference_camera, reference_uncertainty});
  }
  Send(ack);
}

void MapState::Correct(const MapCorrection& correction) {
  std::lock_guard lock(mutex_);
  for (const KeyframeCorrection& keyframe : correction.keyframes) {
    ScaledPose& reference = references_[keyframe.id];
    reference.T_world_camera = keyframe.T_world_camera;
    reference.scale *= keyframe.S_new_old.scale();
  }
  for (const auto& [id, uncertainty] : correction.uncertainties) uncertainties_[id] = uncertainty;
}

SE3<World, Camera> MapState::CurrentPose(const TrajectoryEntry& entry) const {
  if (!entry.reference) return *entry.ack.T_world_camera;
  return references_.at(entry.reference).Compose(entry.T_reference_camera);
}

// The frame must have an uncertainty.
FrameUncertainty MapState::CurrentUncertainty(const TrajectoryEntry& entry) const {
  const auto reference = uncertainties_.find(entry.reference);
  if (reference == uncertainties_.end()) return {.reference = *entry.ack.uncertainty, .relative = {}};
  PoseUncertainty relative = entry.reference_uncertainty;
  relative.position_sigma_mu *= references_.at(entry.reference).scale;
  return {.reference = reference->second, .relative = relative};
}

// `trajectory` has the frames of trajectory_.
void MapState::UpdateUncertainties(std::vector<FrameAck>* trajectory) const {
  std::vector<size_t> indices;
  std::vector<FrameUncertainty> sources;
  for (size_t i = 0; i < trajectory_.size(); ++i) {
    if (!trajectory_[i].ack.uncertainty) continue;
    indices.push_back(i);
    sources.push_back(CurrentUncertainty(trajectory_[i]));
    sources.back().position_world = (*trajectory)[i].T_world_camera->translation();
  }
  const std::vector<PoseUncertainty> aligned = AlignedUncertainties(sources);
  for (size_t k = 0; k < indices.size(); ++k) (*trajectory)[indices[k]].uncertainty = aligned[k];
}

void MapState::Acknowledge(MasksAck ack) {
  std::lock_guard lock(mutex_);
  Send(ack);
}

void MapState::Publish(const Statistics& statistics) {
  std::lock_guard lock(mutex_);
  Send(statistics);
}

std::shared_ptr<Outbox> MapState::Subscribe(Outbox::Acks acks, size_t max_acks) {
  auto outbox = std::make_shared<Outbox>(acks, max_acks);
  std::lock_guard lock(mutex_);
  for (const auto& [id, entry] : objects_) {
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
  for (const TrajectoryEntry& entry : trajectory_) {
    snapshot.trajectory.push_back(entry.ack);
    snapshot.trajectory.back().T_world_camera = CurrentPose(entry);
    snapshot.timestamps_ns.push_back(entry.timestamp_ns);
  }
  UpdateUncertainties(&snapshot.trajectory);
  return snapshot;
}

uint64_t MapState::ConfirmedObjects() const {
  std::lock_guard lock(mutex_);
  return std::count_if(objects_.begin(), objects_.end(),
                       [](const auto& entry) { return entry.second.object.state != ObjectState::kProvisional; });
}

}  // namespace romap::session
