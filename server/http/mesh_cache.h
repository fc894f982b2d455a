#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "common/map_events.h"

namespace romap::http {

// The newest meshes that viewers were told about, which they fetch next. It holds what was used last, up to a number of
// bytes. It does not know who may see a session. Thread-safe.
class MeshCache {
 public:
  explicit MeshCache(size_t max_bytes) : max_bytes_(max_bytes) {}

  // Keeps the mesh, unless a newer one of the object is known.
  std::shared_ptr<const MeshUpdate> Put(const std::string& session_id, MeshUpdate mesh);
  // Null: not known.
  std::shared_ptr<const MeshUpdate> Find(const std::string& session_id, ObjectId object);
  void RemoveSession(const std::string& session_id);

  size_t bytes() const;

 private:
  using Key = std::pair<std::string, ObjectId>;
  struct Entry {
    std::shared_ptr<const MeshUpdate> mesh;
    std::list<Key>::iterator use;
  };

  void Remove(std::map<Key, Entry>::iterator entry);

  const size_t max_bytes_;
  mutable std::mutex mutex_;
  std::map<Key, Entry> entries_;
  std::list<Key> uses_;  // the last used one first
  size_t bytes_ = 0;
};

}  // namespace romap::http
