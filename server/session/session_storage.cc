#include "server/session/session_storage.h"

#include <algorithm>
#include <set>
#include <utility>
#include <variant>
#include <vector>

namespace romap::session {
namespace {

constexpr std::chrono::seconds kMeshPeriod{10};
constexpr std::chrono::seconds kStatePeriod{1};
constexpr size_t kMinTrajectoryGrowth = 100;  // frames

}  // namespace

SessionStorage::SessionStorage(store::Store* store, std::string session_id, FrameMode mode,
                               store::Store::Listener listener)
    : store_(store), session_id_(std::move(session_id)), may_wait_(mode == FrameMode::kReplay) {
  store_->SetListener(session_id_, std::move(listener));
}

SessionStorage::~SessionStorage() {
  store_->RemoveListener(session_id_);
  if (outbox_) map_->Unsubscribe(outbox_);
}

void SessionStorage::Append(const SessionInput& input) { store_->AppendInput(session_id_, input, may_wait_); }

void SessionStorage::Follow(MapState* map, const std::vector<ObjectSnapshot>& stored) {
  std::lock_guard lock(mutex_);
  map_ = map;
  std::vector<ObjectId> current;
  outbox_ = map->Subscribe(Outbox::Acks::kNewest, /*max_acks=*/1, &current);
  const std::set<ObjectId> exists(current.begin(), current.end());
  for (const ObjectSnapshot& snapshot : stored) {
    if (!exists.contains(snapshot.object.id)) store_->RemoveObject(session_id_, snapshot.object.id);
  }
}

void SessionStorage::StoreChanges(const std::function<State()>& state, bool complete) {
  std::lock_guard lock(mutex_);
  if (!outbox_) return;
  while (std::optional<MapEvent> event = outbox_->Next(std::chrono::milliseconds(0))) StoreEvent(*std::move(event));
  StoreMeshes(complete);
  const size_t frames = map_->TrackedFrames();
  if (complete ? frames > 0 : frames >= stored_frames_ + std::max(kMinTrajectoryGrowth, stored_frames_ / 4)) {
    std::vector<FrameAck> trajectory;
    std::vector<int64_t> timestamps_ns;
    map_->CopyTrajectory(&trajectory, &timestamps_ns);
    store_->PutTrajectory(session_id_, std::move(trajectory), std::move(timestamps_ns));
    stored_frames_ = frames;
  }
  const Clock::time_point now = Clock::now();
  if (!complete && now < state_stored_ + kStatePeriod) return;
  PutState(state());
}

void SessionStorage::StoreState(const std::function<State()>& state) {
  std::lock_guard lock(mutex_);  // a later state must not be stored before
  PutState(state());
}

void SessionStorage::PutState(State state) {
  state_stored_ = Clock::now();
  store_->PutState(session_id_, state.state, std::move(state.failure), std::move(state.statistics));
}

void SessionStorage::StoreEvent(MapEvent event) {
  if (auto* object = std::get_if<ObjectUpdate>(&event)) {
    store_->PutObject(session_id_, std::move(*object));
  } else if (auto* mesh = std::get_if<MeshUpdate>(&event)) {
    const ObjectId id = mesh->id;
    meshes_[id].newest = std::move(*mesh);
  } else if (const auto* removed = std::get_if<ObjectRemoved>(&event)) {
    meshes_.erase(removed->id);
    store_->RemoveObject(session_id_, removed->id);
  } else if (const auto* merged = std::get_if<ObjectMerged>(&event)) {
    meshes_.erase(merged->from);
    store_->RemoveObject(session_id_, merged->from);
  }
}

void SessionStorage::StoreMeshes(bool complete) {
  const Clock::time_point now = Clock::now();
  for (auto& [id, mesh] : meshes_) {
    if (!mesh.newest) continue;
    const bool is_due = complete || mesh.newest->final || now >= mesh.last_stored + kMeshPeriod;
    if (!is_due) continue;
    store_->PutMesh(session_id_, *std::exchange(mesh.newest, std::nullopt));
    mesh.last_stored = now;
  }
}

}  // namespace romap::session
