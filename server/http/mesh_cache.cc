#include "server/http/mesh_cache.h"

namespace romap::http {
namespace {

size_t BytesOf(const MeshUpdate& mesh) {
  size_t bytes = sizeof(mesh) + mesh.draco.size() + mesh.texture.image.size();
  for (const MeshLevel& level : mesh.levels) bytes += level.draco.size();
  return bytes;
}

}  // namespace

std::shared_ptr<const MeshUpdate> MeshCache::Put(const std::string& session_id, MeshUpdate mesh) {
  const Key key(session_id, mesh.id);
  auto shared = std::make_shared<const MeshUpdate>(std::move(mesh));
  std::lock_guard lock(mutex_);
  if (const auto known = entries_.find(key); known != entries_.end()) {
    if (known->second.mesh->revision >= shared->revision) return shared;
    Remove(known);
  }
  uses_.push_front(key);
  entries_[key] = {shared, uses_.begin()};
  bytes_ += BytesOf(*shared);
  while (bytes_ > max_bytes_ && !uses_.empty()) Remove(entries_.find(uses_.back()));
  return shared;
}

std::shared_ptr<const MeshUpdate> MeshCache::Find(const std::string& session_id, ObjectId object) {
  std::lock_guard lock(mutex_);
  const auto found = entries_.find(Key(session_id, object));
  if (found == entries_.end()) return nullptr;
  uses_.splice(uses_.begin(), uses_, found->second.use);
  return found->second.mesh;
}

void MeshCache::RemoveSession(const std::string& session_id) {
  std::lock_guard lock(mutex_);
  for (auto entry = entries_.lower_bound(Key(session_id, ObjectId{}));
       entry != entries_.end() && entry->first.first == session_id;) {
    const auto removed = entry++;
    Remove(removed);
  }
}

void MeshCache::Remove(std::map<Key, Entry>::iterator entry) {
  bytes_ -= BytesOf(*entry->second.mesh);
  uses_.erase(entry->second.use);
  entries_.erase(entry);
}

size_t MeshCache::bytes() const {
  std::lock_guard lock(mutex_);
  return bytes_;
}

}  // namespace romap::http
