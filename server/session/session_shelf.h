#pragma once

#include <absl/status/statusor.h>

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/mapping_service.h"
#include "server/session/map_state.h"
#include "server/session/session.h"
#include "server/store/store.h"

namespace romap::session {

// The stored sessions that are not in memory. Their maps are loaded while somebody uses them. Not thread-safe.
class SessionShelf {
 public:
  // `store` outlives the shelf.
  SessionShelf(store::Store* store, std::vector<store::StoredSession> sessions);

  bool Contains(const std::string& session_id) const { return entries_.contains(session_id); }
  std::vector<SessionInfo> Infos() const;
  SessionInfo Info(const std::string& session_id) const;  // requires Contains()
  // Those that were finishing when the server ended.
  std::vector<std::string> Unfinished() const;
  // Those that were not used for `max_age_days` (0: no limit), and the least recently used finished ones while all
  // sessions of the store need more than `max_bytes` (0: no limit). Pinned ones never expire.
  std::vector<std::string> Expired(double max_age_days, double max_bytes, int64_t now_unix_ns) const;

  void Add(store::StoredSession session);
  void Remove(const std::string& session_id) { entries_.erase(session_id); }
  void SetPinned(const std::string& session_id, bool pinned) { entries_.at(session_id).session.pinned = pinned; }

  // The map as it was stored; requires Contains(). It is closed if the session has ended. An error: it cannot be read.
  absl::StatusOr<std::shared_ptr<MapState>> Map(const std::string& session_id);
  // The same as a snapshot.
  absl::StatusOr<MapSnapshot> Export(const std::string& session_id);
  // Removes it from the shelf, to restore it. FAILED_PRECONDITION: it has ended.
  absl::StatusOr<std::pair<store::StoredSession, Session::Stored>> Take(const std::string& session_id);

 private:
  struct Entry {
    store::StoredSession session;
    std::weak_ptr<MapState> map;  // while somebody uses it
  };

  store::Store* const store_;
  std::map<std::string, Entry> entries_;
};

}  // namespace romap::session
