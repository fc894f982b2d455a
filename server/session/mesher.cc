#include "server/session/mesher.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "common/mesh_codec.h"
#include "common/status.h"
#include "common/thread_priority.h"
#include "server/mesh/extract_mesh.h"

namespace romap::session {
namespace {

absl::StatusOr<MeshUpdate> MakeMesh(const FieldSnapshot& snapshot, const mesh::MeshConfig& config) {
  ROMAP_ASSIGN_OR_RETURN(const Mesh mesh, mesh::ExtractMesh(snapshot, config));
  MeshUpdate update;
  update.id = snapshot.object;
  update.steps = snapshot.steps;
  update.train_seconds = snapshot.train_seconds;
  update.final = snapshot.converged;
  update.vertex_count = static_cast<uint32_t>(mesh.vertices.size());
  update.triangle_count = static_cast<uint32_t>(mesh.triangles.size());
  ROMAP_ASSIGN_OR_RETURN(update.draco, EncodeDraco(mesh, DracoOptions{}));
  return update;
}

}  // namespace

Mesher::Mesher(const mesh::MeshConfig& config, Threading threading) : config_(config), threading_(threading) {
  if (threading == Threading::kOwnThread) thread_ = std::thread([this] { Run(); });
}

Mesher::~Mesher() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
    changed_.notify_all();
  }
  if (thread_.joinable()) thread_.join();
}

uint64_t Mesher::Register(Sink sink) {
  std::lock_guard lock(mutex_);
  const uint64_t client = next_client_++;
  sinks_[client] = std::move(sink);
  return client;
}

void Mesher::Unregister(uint64_t client) {
  std::unique_lock lock(mutex_);
  sinks_.erase(client);
  std::erase_if(waiting_, [&](const auto& entry) { return entry.first.first == client; });
  changed_.wait(lock, [&] { return busy_client_ != client; });
}

void Mesher::Offer(uint64_t client, FieldSnapshot snapshot) {
  std::unique_lock lock(mutex_);
  if (!sinks_.contains(client)) return;
  if (threading_ == Threading::kCaller) {
    const Sink sink = sinks_.at(client);
    lock.unlock();
    Serve(sink, snapshot);
    return;
  }
  auto& slot = waiting_[{client, snapshot.object}];
  if (slot.first == 0) slot.first = next_ticket_++;
  slot.second = std::move(snapshot);
  changed_.notify_all();
}

void Mesher::Remove(uint64_t client, ObjectId object) {
  std::lock_guard lock(mutex_);
  waiting_.erase({client, object});
}

bool Mesher::Idle(uint64_t client) const {
  std::lock_guard lock(mutex_);
  return busy_client_ != client &&
         std::none_of(waiting_.begin(), waiting_.end(), [&](const auto& entry) { return entry.first.first == client; });
}

void Mesher::Serve(const Sink& sink, const FieldSnapshot& snapshot) const {
  try {
    if (auto mesh = MakeMesh(snapshot, config_); mesh.ok()) {
      sink(*std::move(mesh), {snapshot.T_world_object, snapshot.S_new_first});
    } else {
      // Early in training there may be no surface yet; the next snapshot brings it.
      spdlog::debug("{}: no mesh after {} steps: {}", snapshot.object.ToString(), snapshot.steps,
                    Message(mesh.status()));
    }
  } catch (const std::exception& e) {  // a library, or memory: this mesh is lost, the next may come
    spdlog::error("{}: meshing failed: {}", snapshot.object.ToString(), e.what());
  }
}

void Mesher::Run() {
  LowerThreadPriority();
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return stopping_ || !waiting_.empty(); });
    if (stopping_) return;
    const auto oldest = std::min_element(waiting_.begin(), waiting_.end(),
                                         [](const auto& a, const auto& b) { return a.second.first < b.second.first; });
    busy_client_ = oldest->first.first;
    const Sink sink = sinks_.at(busy_client_);
    const FieldSnapshot snapshot = std::move(oldest->second.second);
    waiting_.erase(oldest);
    lock.unlock();
    Serve(sink, snapshot);
    lock.lock();
    busy_client_ = 0;
    changed_.notify_all();
  }
}

}  // namespace romap::session
