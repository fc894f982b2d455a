#pragma once

#include <chrono>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "common/mapping_service.h"
#include "server/nerf/training_pool.h"
#include "server/session/mesher.h"
#include "server/session/server_config.h"
#include "server/session/session.h"
#include "server/session/session_shelf.h"
#include "server/store/store.h"

namespace romap::session {

// The mapping service in this process: owns the sessions, the training pool and the mesh thread. Thread-safe. All
// streams must be destroyed before the service.
//
// With a store, sessions survive this service. Those that nobody uses are on the shelf (SessionShelf): they are listed,
// watched and exported from the store. An open one is restored when a client opens it, and an unfinished one that was
// closed at once.
class LocalMappingService : public MappingService {
 public:
  // `store` may be null: then sessions end with the service.
  explicit LocalMappingService(const ServerConfig& config, std::unique_ptr<store::Store> store = nullptr);
  ~LocalMappingService() override;

  absl::StatusOr<SessionInfo> CreateSession(const SessionOptions& options) override;
  absl::StatusOr<std::vector<SessionInfo>> ListSessions() override;
  absl::StatusOr<SessionInfo> GetSession(const std::string& session_id) override;
  absl::StatusOr<SessionInfo> FinishSession(const std::string& session_id) override;
  absl::Status DeleteSession(const std::string& session_id) override;
  using MappingService::LoadSession;
  using MappingService::OpenMap;
  absl::StatusOr<std::unique_ptr<MapStream>> OpenMap(const std::string& session_id,
                                                     const std::string& resume_token) override;
  absl::StatusOr<std::unique_ptr<EventStream>> Watch(const std::string& session_id) override;
  absl::StatusOr<MapSnapshot> ExportMap(const std::string& session_id) override;
  absl::StatusOr<SparsePoints> Points(const std::string& session_id) override;
  absl::StatusOr<CameraImage> NewestImage(const std::string& session_id, int max_side_px) override;
  absl::Status SaveSession(const std::string& session_id, const PieceWriter& write) override;
  absl::StatusOr<SessionInfo> LoadSession(const PieceReader& read, const std::string& tenant) override;
  absl::StatusOr<SessionInfo> PinSession(const std::string& session_id, bool pinned) override;

  ServiceMetrics Metrics() const;

  // A thread of a session hangs. Then the destructor does not return; the process must be ended without it.
  bool HasHangingSession();
  // Stores all changes and waits for the disk.
  void StoreAll();

 private:
  // RESOURCE_EXHAUSTED: the processor cannot take another live session.
  absl::Status CheckLiveLoadLocked(const CameraModel& camera) const;
  std::map<std::string, std::shared_ptr<Session>> SessionsInMemory();
  // Null: it is on the shelf. NOT_FOUND: there is no such session.
  absl::StatusOr<std::shared_ptr<Session>> FindLocked(const std::string& session_id);
  absl::Status CheckStore() const;
  Session::Services Services() {
    return {.pool = &pool_, .mesher = &mesher_, .store = store_.get(), .counters = &counters_};
  }
  absl::Status RestoreLocked(const std::string& session_id);

  void LoadShelf();

  // The keeper thread: deletes empty sessions that nobody uses, stores changes, and puts sessions that ended or that
  // nobody uses on the shelf.
  void KeepSessions();
  void DeleteAbandoned();
  void CheckStages();
  void StoreChanges();
  bool IsUnused(const std::string& session_id, const Session& session);
  void Shelve(const std::string& session_id, std::shared_ptr<Session> session);
  void DeleteExpired();

  const ServerConfig config_;
  const std::unique_ptr<store::Store> store_;  // null: nothing is stored
  ServiceCounters counters_;
  nerf::TrainingPool pool_;
  Mesher mesher_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Session>> sessions_;  // in memory
  size_t sessions_in_creation_ = 0;
  std::vector<std::shared_ptr<Session>> hanging_;  // that were deleted or shelved; they are never destroyed
  std::unique_ptr<SessionShelf> shelf_;            // null without a store
  std::condition_variable stopping_changed_;
  bool stopping_ = false;
  std::map<std::string, std::chrono::steady_clock::time_point> unused_since_;  // the keeper thread
  std::map<std::string, std::chrono::steady_clock::time_point> empty_since_;   // the same
  std::thread keeper_thread_;
};

}  // namespace romap::session
