#include "client/sdk/internal/seen_objects.h"

#include <algorithm>

namespace romap::client {

void SeenObjects::Note(const MapEvent& event) {
  if (const auto* update = std::get_if<ObjectUpdate>(&event)) {
    uint64_t& revision = revisions_[update->id];
    revision = std::max(revision, update->revision);
  } else if (const auto* mesh = std::get_if<MeshUpdate>(&event)) {
    const auto it = revisions_.find(mesh->id);
    if (it != revisions_.end()) it->second = std::max(it->second, mesh->revision);
  } else if (const auto* removed = std::get_if<ObjectRemoved>(&event)) {
    revisions_.erase(removed->id);
  } else if (const auto* merged = std::get_if<ObjectMerged>(&event)) {
    revisions_.erase(merged->from);
    const auto into = revisions_.find(merged->into);
    if (into != revisions_.end()) into->second = std::max(into->second, merged->revision);
  }
}

std::vector<ObjectRemoved> SeenObjects::KeepOnly(const std::vector<ObjectId>& existing) {
  const std::set<ObjectId> kept(existing.begin(), existing.end());
  std::vector<ObjectRemoved> removals;
  for (auto it = revisions_.begin(); it != revisions_.end();) {
    if (kept.contains(it->first)) {
      ++it;
      continue;
    }
    removals.push_back(
        {.id = it->first, .revision = it->second + 1, .reason = "removed while the connection was broken"});
    it = revisions_.erase(it);
  }
  return removals;
}

}  // namespace romap::client
