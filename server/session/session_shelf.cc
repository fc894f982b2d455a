#include "server/session/session_shelf.h"

#include <algorithm>
#include <utility>

#include "common/status.h"

namespace romap::session {
SessionShelf::SessionShelf(store::Store* store, std::vector<store::StoredSession> sessions) : store_(store) {
  for (store::StoredSession& session : sessions) Add(std::move(session));
}

void SessionShelf::Add(store::StoredSession session) {
  std::string id = session.id;
  entries_[std::move(id)] = {std::move(session), {}};
}

std::vector<SessionInfo> SessionShelf::Infos() const {
  std::vector<SessionInfo> infos;
  for (const auto& [id, entry] : entries_) infos.push_back(Info(id));
  return infos;
}

SessionInfo SessionShelf::Info(const std::string& session_id) const {
  SessionInfo info = store::InfoOf(entries_.at(session_id).session);
  info.stored_bytes = store_->BytesOf(session_id);
  return info;
}

std::vector<std::string> SessionShelf::Unfinished() const {
  std::vector<std::string> ids;
  for (const auto& [id, entry] : entries_) {
    if (entry.session.state == SessionState::kFinishing) ids.push_back(id);
  }
  return ids;
}

std::vector<std::string> SessionShelf::Expired(double max_age_days, double max_bytes, int64_t now_unix_ns) const {
  std::vector<const store::StoredSession*> oldest_first;
  for (const auto& [id, entry] : entries_) {
    if (!entry.session.pinned && entry.map.expired()) oldest_first.push_back(&entry.session);
  }
  std::sort(oldest_first.begin(), oldest_first.end(),
            [](const auto* a, const auto* b) { return a->used_unix_ns < b->used_unix_ns; });
  double bytes = 0;
  if (max_bytes > 0) {
    for (const auto& [id, entry] : entries_) bytes += static_cast<double>(store_->BytesOf(id));
  }
  std::vector<std::string> expired;
  for (const store::StoredSession* session : oldest_first) {
    const double age_days = static_cast<double>(now_unix_ns - session->used_unix_ns) / 86'400e9;
    const bool is_old = max_age_days > 0 && age_days > max_age_days;
    const bool is_too_much = max_bytes > 0 && bytes > max_bytes && store::HasEnded(session->state);
    if (!is_old && !is_too_much) continue;
    if (max_bytes > 0) bytes -= static_cast<double>(store_->BytesOf(session->id));
    expired.push_back(session->id);
  }
  return expired;
}

absl::StatusOr<std::shared_ptr<MapState>> SessionShelf::Map(const std::string& session_id) {
  Entry& entry = entries_.at(session_id);
  if (auto map = entry.map.lock()) return map;
  ROMAP_ASSIGN_OR_RETURN(store::StoredMap stored, store_->LoadMap(session_id));
  for (const std::string& damage : stored.damage) {
    std::vector<Diagnostic>& diagnostics = entry.session.statistics.diagnostics;
    std::erase_if(diagnostics, [](const Diagnostic& known) { return known.code == "stored_data_damaged"; });
    diagnostics.push_back({.code = "stored_data_damaged",
                           .severity = Severity::kWarning,
                           .count = stored.damage.size(),
                           .text = "a part of the stored session is damaged and was left out: " + damage});
  }
  auto map = std::make_shared<MapState>();
  map->Load(std::move(stored.objects), std::move(stored.trajectory), std::move(stored.timestamps_ns),
            stored.last_object);
  if (entry.session.state == SessionState::kFinished) map->Close(absl::OkStatus());
  if (entry.session.state == SessionState::kFailed) {
    map->Close(Internal("session '{}': {}", session_id, entry.session.failure));
  }
  entry.map = map;
  return map;
}

absl::StatusOr<MapSnapshot> SessionShelf::Export(const std::string& session_id) {
  ROMAP_ASSIGN_OR_RETURN(const std::shared_ptr<MapState> map, Map(session_id));
  const store::StoredSession& session = entries_.at(session_id).session;
  MapSnapshot snapshot = map->Snapshot();
  snapshot.session_id = session_id;
  snapshot.state = session.state;
  snapshot.statistics = session.statistics;
  return snapshot;
}

absl::StatusOr<std::pair<store::StoredSession, Session::Stored>> SessionShelf::Take(const std::string& session_id) {
  store::StoredSession& session = entries_.at(session_id).session;
  if (session.state == SessionState::kFailed) {
    return FailedPrecondition("session '{}' accepts no more frames, because {}", session_id, session.failure);
  }
  if (session.state == SessionState::kFinished) {
    return FailedPrecondition("session '{}' was finished and accepts no more frames", session_id);
  }
  Session::Stored stored;
  stored.state = session.state;
  stored.inputs = session.inputs;
  ROMAP_ASSIGN_OR_RETURN(stored.map, Map(session_id));
  stored.statistics = session.statistics;
  stored.pinned = session.pinned;
  std::pair<store::StoredSession, Session::Stored> taken(std::move(session), std::move(stored));
  entries_.erase(session_id);
  return taken;
}

}  // namespace romap::session
