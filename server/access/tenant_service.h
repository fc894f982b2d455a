#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/mapping_service.h"
#include "server/access/identity.h"
#include "server/access/tenant_limits.h"

namespace romap::access {

// A MappingService as one caller sees it: the sessions of the caller's tenant, or all for an admin, and the calls that
// the caller's role allows. PERMISSION_DENIED: the role does not allow the call. A session of another tenant does not
// exist: NOT_FOUND.
class TenantService : public MappingService {
 public:
  // `service` outlives this object and its streams. `limits`: of the tenant.
  TenantService(MappingService* service, Identity identity, std::shared_ptr<TenantLimits> limits)
      : service_(service), identity_(std::move(identity)), limits_(std::move(limits)) {}

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
  absl::StatusOr<SparsePoints> Points(const std::string& session_id) override;
  absl::StatusOr<CameraImage> NewestImage(const std::string& session_id, int max_side_px) override;
  absl::Status SaveSession(const std::string& session_id, const PieceWriter& write) override;
  using MappingService::LoadSession;
  // `tenant` is ignored: the session belongs to the caller's.
  absl::StatusOr<SessionInfo> LoadSession(const PieceReader& read, const std::string& tenant) override;
  absl::StatusOr<SessionInfo> PinSession(const std::string& session_id, bool pinned) override;

 private:
  absl::Status CheckRole(Role needed, const char* call) const;
  bool MaySee(const SessionInfo& info) const;
  // Also whether the session is visible.
  absl::Status CheckSession(Role needed, const char* call, const std::string& session_id);
  absl::Status CheckRoomForSession();

  MappingService* const service_;
  const Identity identity_;
  const std::shared_ptr<TenantLimits> limits_;
};

}  // namespace romap::access
