#include "client/sdk/map_copy.h"

#include <algorithm>
#include <optional>
#include <variant>

namespace romap::client {

void MapCopy::Apply(const MapEvent& event) {
  if (const auto* update = std::get_if<ObjectUpdate>(&event)) {
    ObjectUpdate& object = objects_[update->id].object;
    if (update->revision >= object.revision) object = *update;
  } else if (const auto* mesh = std::get_if<MeshUpdate>(&event)) {
    const auto it = objects_.find(mesh->id);
    if (it == objects_.end()) return;
    std::optional<MeshUpdate>& newest = it->second.mesh;
    if (!newest || mesh->revision >= newest->revision) newest = *mesh;
  } else if (const auto* removed = std::get_if<ObjectRemoved>(&event)) {
    objects_.erase(removed->id);
  } else if (const auto* merged = std::get_if<ObjectMerged>(&event)) {
    objects_.erase(merged->from);
    const auto into = objects_.find(merged->into);
    if (into != objects_.end()) into->second.object.revision = std::max(into->second.object.revision, merged->revision);
  }
}

}  // namespace romap::client
