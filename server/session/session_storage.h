#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "common/mapping_service.h"
#include "server/session/map_state.h"
#include "server/session/outbox.h"
#include "server/store/store.h"

namespace romap::session {

// Stores one session: its inputs as they are accepted, and its map as clients see it. Thread-safe.
class SessionStorage {
 public:
  // `store` outlives this object. The callbacks come from the store's thread, until the destructor.
  SessionStorage(store::Store* store, std::string session_id, FrameMode mode, store::Store::Listener listener);
  ~SessionStorage();
  SessionStorage(const SessionStorage&) = delete;
  SessionStorage& operator=(const SessionStorage&) = delete;

  // A replay session waits while the disk is slow.
  void Append(const SessionInput& input);

  // Begins to store the changes of the map. `stored`: the objects that are stored now; those that the map does not have
  // are removed.
  void Follow(MapState* map, const std::vector<ObjectSnapshot>& stored);
  struct State {
    SessionState state = SessionState::kOpen;
    std::string failure;
    Statistics statistics;
  };
  // Stores what has changed since the last call. Unless `complete`, a mesh that is still being trained is stored only
  // now and then, and the trajectory when it has grown by a quarter, because old versions stay on the disk.
  void StoreChanges(const std::function<State()>& state, bool complete);
  void StoreState(const std::function<State()>& state);

 private:
  using Clock = std::chrono::steady_clock;
  // A mesh that is not stored yet.
  struct WaitingMesh {
    Clock::time_point last_stored;
    std::optional<MeshUpdate> newest;
  };

  void StoreEvent(MapEvent event);
  void PutState(State state);
  void StoreMeshes(bool complete);

  store::Store* const store_;
  const std::string session_id_;
  const bool may_wait_;

  std::mutex mutex_;
  MapState* map_ = nullptr;
  std::shared_ptr<Outbox> outbox_;  // null before Follow()
  std::map<ObjectId, WaitingMesh> meshes_;
  size_t stored_frames_ = 0;  // length of the stored trajectory
  Clock::time_point state_stored_;
};

}  // namespace romap::session
