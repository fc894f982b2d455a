#include "server/http/class_filter.h"

#include <algorithm>
#include <utility>

namespace romap::http {

ClassFilter::Result ClassFilter::Apply(MapEvent event) {
  if (!classes_.empty()) {
    if (auto* update = std::get_if<ObjectUpdate>(&event)) return ApplyUpdate(std::move(*update));
    if (const auto* merged = std::get_if<ObjectMerged>(&event)) return ApplyMerge(*merged);
    const auto* mesh = std::get_if<MeshUpdate>(&event);
    if (mesh != nullptr && !shown_.contains(mesh->id)) return {};
    const auto* removed = std::get_if<ObjectRemoved>(&event);
    if (removed != nullptr && shown_.erase(removed->id) == 0) return {};
  }
  return {.events = {std::move(event)}};
}

ClassFilter::Result ClassFilter::ApplyUpdate(ObjectUpdate update) {
  if (classes_.contains(update.class_name)) {
    const bool joins = shown_.insert(update.id).second;
    const ObjectId id = update.id;
    return {.events = {std::move(update)}, .joined = joins ? id : ObjectId{}};
  }
  if (shown_.erase(update.id) == 0) return {};
  return {
      .events = {ObjectRemoved{.id = update.id, .revision = update.revision, .reason = "it has another class now"}}};
}

ClassFilter::Result ClassFilter::ApplyMerge(const ObjectMerged& merged) {
  if (shown_.erase(merged.from) == 0) return {};
  if (shown_.contains(merged.into)) return {.events = {merged}};
  return {
      .events = {ObjectRemoved{
          .id = merged.from, .revision = merged.revision, .reason = "it was merged into an object of another class"}}};
}

std::set<std::string> ParseClasses(const std::string& text) {
  std::set<std::string> classes;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    if (end > begin) classes.insert(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return classes;
}

}  // namespace romap::http
