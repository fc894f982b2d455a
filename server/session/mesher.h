#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "common/field_snapshot.h"
#include "common/map_events.h"
#include "server/mesh/mesh_config.h"
#include "server/session/mesh_pose.h"

namespace romap::session {

// The server's mesh thread: converts the field snapshots of all sessions to Draco meshes, oldest first. Per object only
// the newest snapshot waits. A mesh with a texture takes many times as long as one without, so final meshes wait until
// their session sends no other snapshots. Thread-safe.
class Mesher {
 public:
  using SessionId = uint64_t;
  using Sink = std::function<void(MeshUpdate, const MeshPose&)>;

  enum class Threading {
    kOwnThread,
    kCaller,  // Offer() makes the mesh before it returns
  };

  // When final meshes are made.
  struct Waits {
    // After this pause a session is considered to send no more snapshots. Longer than the interval of its snapshots.
    std::chrono::milliseconds quiet{1500};
    // A final mesh of a session that never pauses waits no longer.
    std::chrono::milliseconds longest{20'000};
  };

  explicit Mesher(const mesh::MeshConfig& config, Threading threading = Threading::kOwnThread)
      : Mesher(config, threading, Waits{}) {}
  Mesher(const mesh::MeshConfig& config, Threading threading, Waits waits);
  ~Mesher();

  // `session_id`: for the log.
  SessionId AddSession(Sink sink, const std::string& session_id = "");
  // Waits for a running call of this session's sink; none follows.
  void RemoveSession(SessionId session);
  // Calls with the id of a removed session have no effect.
  void Offer(SessionId session, FieldSnapshot snapshot);
  // Discards the waiting snapshot of an object that was removed.
  void RemoveObject(SessionId session, ObjectId object);
  // No snapshot of the session waits or is being meshed.
  bool IsIdle(SessionId session) const;

 private:
  using Clock = std::chrono::steady_clock;
  using Key = std::pair<SessionId, ObjectId>;
  struct WaitingSnapshot {
    uint64_t ticket = 0;  // order of arrival of the object's first waiting snapshot
    Clock::time_point since = {};
    FieldSnapshot snapshot;
  };
  using Waiting = std::map<Key, WaitingSnapshot>;
  struct Receiver {
    Sink sink;
    std::string session_id;
  };

  void Run();
  Clock::time_point DueTime(const Waiting::value_type& entry) const;
  Waiting::iterator FirstDue();
  void MakeMesh(const Receiver& receiver, const FieldSnapshot& snapshot) const;

  const mesh::MeshConfig config_;
  const Threading threading_;
  const Waits waits_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::map<SessionId, Receiver> receivers_;
  std::map<SessionId, Clock::time_point> last_offer_;
  Waiting waiting_;
  SessionId next_session_ = 1;
  uint64_t next_ticket_ = 1;
  SessionId busy_session_ = 0;  // whose snapshot the thread is meshing; 0 = none
  bool stopping_ = false;
  std::thread thread_;  // kOwnThread only
};

}  // namespace romap::session
