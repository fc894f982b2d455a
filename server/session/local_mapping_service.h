#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include "common/mapping_service.h"
#include "server/nerf/training_pool.h"
#include "server/session/mesher.h"
#include "server/session/server_config.h"
#include "server/session/session.h"

namespace romap::session {

// The mapping service in this process: owns the sessions, the training pool and the mesh thread. Thread-safe. All
// streams must be destroyed before the service.
class LocalMappingService : public MappingService {
 public:
  explicit LocalMappingService(const ServerConfig& config);
  ~LocalMappingService() override;

  absl::StatusOr<SessionInfo> CreateSession(const SessionOptions& options) override;
  absl::StatusOr<std::vector<SessionInfo>> ListSessions() override;
  absl::StatusOr<SessionInfo> GetSession(const std::string& session_id) override;
  absl::StatusOr<SessionInfo> FinishSession(const std::string& session_id) override;
  absl::Status DeleteSession(const std::string& session_id) override;
  using MappingService::OpenMap;
  absl::StatusOr<std::unique_ptr<MapStream>> OpenMap(const std::string& session_id,
                                                     const std::string& resume_token) override;
  absl::StatusOr<std::unique_ptr<EventStream>> Watch(const std::string& session_id) override;
  absl::StatusOr<MapSnapshot> ExportMap(const std::string& session_id) override;

 private:
  absl::StatusOr<std::shared_ptr<Session>> Find(const std::string& session_id) const;
  std::string NewId();

  const ServerConfig config_;
  nerf::TrainingPool pool_;
  Mesher mesher_;
  mutable std::mutex mutex_;
  std::mt19937_64 random_{std::random_device{}()};
  std::map<std::string, std::shared_ptr<Session>> sessions_;
};

}  // namespace romap::session
