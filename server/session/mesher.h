#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <thread>
#include <utility>

#include "common/field_snapshot.h"
#include "common/map_events.h"
#include "server/mesh/mesh_config.h"
#include "server/session/mesh_place.h"

namespace romap::session {

// The server's mesh thread: field snapshots in, Draco meshes out. Per object only the newest snapshot waits. Without a
// thread of its own it makes each mesh in Offer().
class Mesher {
 public:
  using Sink = std::function<void(MeshUpdate, const MeshPlace&)>;

  enum class Threading { kOwnThread, kCaller };

  explicit Mesher(const mesh::MeshConfig& config, Threading threading = Threading::kOwnThread);
  ~Mesher();

  uint64_t Register(Sink sink);
  // Returns when no call of this client's sink is under way; none comes afterwards.
  void Unregister(uint64_t client);
  void Offer(uint64_t client, FieldSnapshot snapshot);
  // Drops what waits of an object that is gone.
  void Remove(uint64_t client, ObjectId object);
  bool Idle(uint64_t client) const;

 private:
  using Key = std::pair<uint64_t, ObjectId>;

  void Run();
  void Serve(const Sink& sink, const FieldSnapshot& snapshot) const;

  const mesh::MeshConfig config_;
  const Threading threading_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::map<uint64_t, Sink> sinks_;
  std::map<Key, std::pair<uint64_t, FieldSnapshot>> waiting_;  // with a ticket: the oldest is served first
  uint64_t next_client_ = 1;
  uint64_t next_ticket_ = 1;
  uint64_t busy_client_ = 0;
  bool stopping_ = false;
  std::thread thread_;  // kOwnThread only
};

}  // namespace romap::session
