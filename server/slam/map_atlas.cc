#include "server/slam/map_atlas.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace romap::slam {

MapAtlas::MapAtlas(const SlamConfig& config)
    : config_(config), current_(std::make_unique<SessionMap>(config, SparseMapId{1}, 0, 0)) {}

SessionMap* MapAtlas::Find(SparseMapId id) const {
  if (current_->id == id) return current_.get();
  const auto found = std::find_if(kept_.begin(), kept_.end(), [&](const auto& map) { return map->id == id; });
  return found == kept_.end() ? nullptr : found->get();
}

size_t MapAtlas::points() const {
  size_t points = current_->map.points().size();
  for (const auto& map : kept_) points += map->map.points().size();
  return points;
}

std::vector<Diagnostic> MapAtlas::Diagnostics() const {
  std::vector<Diagnostic> diagnostics = current_->Diagnostics();
  if (maps() > 1) {
    diagnostics.push_back(
        {.code = "maps_unconnected",
         .text = fmt::format("{} maps with unknown relation, because the camera was lost and did not recognize the "
                             "place: position, direction and scale of each relative to the others are a guess; show "
                             "the camera a place that it has seen before",
                             maps())});
  }
  return diagnostics;
}

std::pair<uint64_t, uint64_t> MapAtlas::UsedIds() const {
  uint64_t keyframes = current_->map.keyframe_count();
  uint64_t points = current_->map.point_count();
  for (const auto& map : kept_) {
    keyframes = std::max(keyframes, map->map.keyframe_count());
    points = std::max(points, map->map.point_count());
  }
  return {keyframes, points};
}

std::unique_ptr<SessionMap> MapAtlas::MakeMap() const {
  SparseMapId last = last_begun_;
  if (!current_->map.keyframes().empty()) last = std::max(last, current_->id);
  const auto [keyframes, points] = UsedIds();
  auto made = std::make_unique<SessionMap>(config_, SparseMapId{last.value + 1}, keyframes, points);
  // The camera is the same. The features of the frames since it was lost were corrected by the same lens.
  made->map.CorrectLens(current_->map.lens());
  return made;
}

void MapAtlas::Begin(std::unique_ptr<SessionMap> map) {
  last_begun_ = std::max(last_begun_, map->id);
  if (!current_->IsEmpty()) kept_.push_back(std::move(current_));
  current_ = std::move(map);
}

void MapAtlas::Discard(std::unique_ptr<SessionMap> map) {
  current_->map.SkipIds(map->map.keyframe_count(), map->map.point_count());
  if (current_->IsEmpty()) current_ = MakeMap();
}

void MapAtlas::SwitchTo(SparseMapId kept) {
  const auto found = std::find_if(kept_.begin(), kept_.end(), [&](const auto& map) { return map->id == kept; });
  if (found == kept_.end()) return;
  const auto [keyframes, points] = UsedIds();
  std::unique_ptr<SessionMap> next = std::move(*found);
  kept_.erase(found);
  next->map.SkipIds(keyframes, points);
  Begin(std::move(next));
}

void MapAtlas::Merge(const MapMerge& merge) {
  const bool has_camera = current_->id == merge.from;
  Find(merge.into)->Absorb(*Find(merge.from), has_camera);
  const auto is = [](SparseMapId id) { return [id](const auto& map) { return map->id == id; }; };
  if (has_camera) std::swap(current_, *std::find_if(kept_.begin(), kept_.end(), is(merge.into)));
  std::erase_if(kept_, is(merge.from));
}

std::optional<MapAtlas::Place> MapAtlas::Relocalize(const FrameFeatures& frame) const {
  if (auto located = current_->places.Relocalize(frame)) return Place{current_->id, *std::move(located)};
  std::optional<Place> best;
  for (const auto& map : kept_) {
    auto located = map->places.Relocalize(frame);
    if (!located || (best && best->located.points.size() >= located->points.size())) continue;
    best = Place{map->id, *std::move(located)};
  }
  return best;
}

}  // namespace romap::slam
