#include "server/access/tenant_service.h"

#include <algorithm>
#include <utility>

#include "common/status.h"
#include "server/access/tenant_stream.h"
#include "server/access/token_store.h"

namespace romap::access {
namespace {

// RESOURCE_EXHAUSTED: the sessions of the tenant need more on the disk. `max_bytes`: 0 = no limit.
absl::Status CheckStoredBytes(MappingService& service, const std::string& tenant, double max_bytes) {
  if (max_bytes <= 0) return absl::OkStatus();
  ROMAP_ASSIGN_OR_RETURN(const std::vector<SessionInfo> sessions, service.ListSessions());
  double stored_bytes = 0;
  for (const SessionInfo& info : sessions) {
    if (info.tenant == tenant) stored_bytes += static_cast<double>(info.stored_bytes);
  }
  if (stored_bytes < max_bytes) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      fmt::format("the sessions of the tenant {} need {:.2f} GiB on the disk, and {:.2f} GiB are allowed "
                  "(access.max_stored_gib_per_tenant); delete sessions first",
                  tenant, stored_bytes / 0x1p30, max_bytes / 0x1p30));
}

}  // namespace

absl::Status TenantService::CheckRole(Role needed, const char* call) const {
  if (identity_.role >= needed) return absl::OkStatus();
  return absl::PermissionDeniedError(fmt::format("{} needs a token with the role {}; this one has the role {}", call,
                                                 ToString(needed), ToString(identity_.role)));
}

bool TenantService::MaySee(const SessionInfo& info) const {
  return identity_.role == Role::kAdmin || info.tenant == identity_.tenant;
}

absl::Status TenantService::CheckSession(Role needed, const char* call, const std::string& session_id) {
  ROMAP_RETURN_IF_ERROR(CheckRole(needed, call));
  const absl::StatusOr<SessionInfo> info = service_->GetSession(session_id);
  if (!info.ok()) return info.status();
  // The message of a session that does not exist.
  if (!MaySee(*info)) return NotFound("session '{}' does not exist", session_id);
  return absl::OkStatus();
}

absl::Status TenantService::CheckRoomForSession() {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<SessionInfo> sessions, service_->ListSessions());
  const auto open = std::ranges::count_if(sessions, [&](const SessionInfo& info) {
    return info.tenant == identity_.tenant && info.state != SessionState::kFinished &&
           info.state != SessionState::kFailed;
  });
  if (open < limits_->max_sessions) return CheckStoredBytes(*service_, identity_.tenant, limits_->max_stored_bytes);
  return absl::ResourceExhaustedError(
      fmt::format("the tenant {} has {} open sessions, as many as it may have (access.max_sessions_per_tenant); finish "
                  "or delete one first",
                  identity_.tenant, open));
}

absl::StatusOr<SessionInfo> TenantService::CreateSession(const SessionOptions& options) {
  ROMAP_RETURN_IF_ERROR(CheckRole(Role::kOwner, "CreateSession"));
  ROMAP_RETURN_IF_ERROR(CheckRoomForSession());
  SessionOptions owned = options;
  owned.tenant = identity_.tenant;
  return service_->CreateSession(owned);
}

absl::StatusOr<std::vector<SessionInfo>> TenantService::ListSessions() {
  ROMAP_ASSIGN_OR_RETURN(std::vector<SessionInfo> sessions, service_->ListSessions());
  std::erase_if(sessions, [&](const SessionInfo& info) { return !MaySee(info); });
  return sessions;
}

absl::StatusOr<SessionInfo> TenantService::GetSession(const std::string& session_id) {
  ROMAP_ASSIGN_OR_RETURN(SessionInfo info, service_->GetSession(session_id));
  if (!MaySee(info)) return NotFound("session '{}' does not exist", session_id);
  return info;
}

absl::StatusOr<SessionInfo> TenantService::FinishSession(const std::string& session_id) {
  ROMAP_RETURN_IF_ERROR(CheckSession(Role::kOwner, "FinishSession", session_id));
  return service_->FinishSession(session_id);
}

absl::Status TenantService::DeleteSession(const std::string& session_id) {
  ROMAP_RETURN_IF_ERROR(CheckSession(Role::kOwner, "DeleteSession", session_id));
  return service_->DeleteSession(session_id);
}

absl::StatusOr<std::unique_ptr<MapStream>> TenantService::OpenMap(const std::string& session_id,
                                                                  const std::string& resume_token) {
  ROMAP_RETURN_IF_ERROR(CheckSession(Role::kOwner, "Map", session_id));
  const auto check_room = [service = service_, tenant = identity_.tenant, max_bytes = limits_->max_stored_bytes] {
    return CheckStoredBytes(*service, tenant, max_bytes);
  };
  ROMAP_RETURN_IF_ERROR(check_room());
  ROMAP_ASSIGN_OR_RETURN(std::unique_ptr<MapStream> stream, service_->OpenMap(session_id, resume_token));
  return std::make_unique<TenantStream>(std::move(stream), limits_, check_room);
}

absl::StatusOr<std::unique_ptr<EventStream>> TenantService::Watch(const std::string& session_id) {
  ROMAP_RETURN_IF_ERROR(CheckSession(Role::kViewer, "Watch", session_id));
  return service_->Watch(session_id);
}

absl::StatusOr<MapSnapshot> TenantService::ExportMap(const std::string& session_id) {
  ROMAP_RETURN_IF_ERROR(CheckSession(Role::kViewer, "ExportMap", session_id));
  return service_->ExportMap(session_id);
}

absl::StatusOr<SparsePoints> TenantService::Points(const std::string& session_id) {
  ROMAP_RETURN_IF_ERROR(CheckSession(Role::kViewer, "Points", session_id));
  return service_->Points(session_id);
}

absl::StatusOr<CameraImage> TenantService::NewestImage(const std::string& session_id, int max_side_px) {
  ROMAP_RETURN_IF_ERROR(CheckSession(Role::kViewer, "NewestImage", session_id));
  return service_->NewestImage(session_id, max_side_px);
}

absl::Status TenantService::SaveSession(const std::string& session_id, const PieceWriter& write) {
  ROMAP_RETURN_IF_ERROR(CheckSession(Role::kViewer, "SaveSession", session_id));
  return service_->SaveSession(session_id, write);
}

absl::StatusOr<SessionInfo> TenantService::LoadSession(const PieceReader& read, const std::string& /*tenant*/) {
  ROMAP_RETURN_IF_ERROR(CheckRole(Role::kOwner, "LoadSession"));
  ROMAP_RETURN_IF_ERROR(CheckRoomForSession());
  return service_->LoadSession(read, identity_.tenant);
}

absl::StatusOr<SessionInfo> TenantService::PinSession(const std::string& session_id, bool pinned) {
  ROMAP_RETURN_IF_ERROR(CheckSession(Role::kOwner, "PinSession", session_id));
  return service_->PinSession(session_id, pinned);
}

}  // namespace romap::access
