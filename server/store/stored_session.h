#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/mapping_service.h"

namespace romap::store {

// What the store knows about a session without reading its map.
struct StoredSession {
  std::string id;
  SessionOptions options;
  int64_t created_unix_ns = 0;
  int64_t used_unix_ns = 0;                  // of the last change
  SessionState state = SessionState::kOpen;  // never kRestoring
  std::string failure = {};                  // why the state is kFailed
  Statistics statistics = {};                // when it was stored last
  bool complete = true;                      // false while it is being imported: it is not listed
  bool pinned = false;                       // never deleted by age or size
  uint64_t inputs = 0;                       // frames and late masks
};

inline bool HasEnded(SessionState state) { return state == SessionState::kFinished || state == SessionState::kFailed; }

// Without the size on the disk and the state of its stream.
inline SessionInfo InfoOf(const StoredSession& session) {
  SessionInfo info;
  info.id = session.id;
  info.name = session.options.name;
  info.tenant = session.options.tenant;
  info.camera = session.options.camera;
  info.mode = session.options.mode;
  info.state = session.state;
  info.created_unix_ns = session.created_unix_ns;
  info.statistics = session.statistics;
  info.durable = true;
  info.pinned = session.pinned;
  return info;
}

// The map of a session as clients saw it last.
struct StoredMap {
  std::vector<ObjectSnapshot> objects;  // all, also provisional ones, by id
  std::vector<FrameAck> trajectory;     // as MapSnapshot
  std::vector<int64_t> timestamps_ns;
  ObjectId last_object;             // the largest id that was ever used
  std::vector<std::string> damage;  // parts that could not be read, as messages; they are missing above
};

}  // namespace romap::store
