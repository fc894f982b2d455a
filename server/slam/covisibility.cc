#include "server/slam/covisibility.h"

#include <set>

namespace romap::slam {
namespace {

constexpr size_t kMaxPoints = 8000;

}  // namespace

std::vector<KeyframeId> Neighborhood(const SlamMap& map, const MapKeyframe& keyframe, size_t max_neighbors,
                                     size_t max_second_neighbors) {
  std::vector<KeyframeId> ids;
  std::set<KeyframeId> known = {keyframe.id};
  auto neighbors = map.Covisible(keyframe, kMinSharedPoints);
  if (neighbors.empty() && keyframe.parent) neighbors.emplace_back(keyframe.parent, 0);
  if (neighbors.size() > max_neighbors) neighbors.resize(max_neighbors);
  for (const auto& [id, shared] : neighbors) {
    if (known.insert(id).second) ids.push_back(id);
  }
  if (max_second_neighbors == 0) return ids;
  for (const auto& [id, shared] : neighbors) {
    size_t taken = 0;
    for (const auto& [next, count] : map.Covisible(*map.FindKeyframe(id), kMinSharedPoints)) {
      if (taken++ == max_second_neighbors) break;
      if (known.insert(next).second) ids.push_back(next);
    }
  }
  return ids;
}

std::vector<MapPointId> PointsOf(const SlamMap& map, const std::vector<KeyframeId>& keyframes) {
  std::set<MapPointId> points;
  for (const KeyframeId id : keyframes) {
    for (const MapPointId point : map.FindKeyframe(id)->points) {
      if (point) points.insert(point);
    }
    if (points.size() > kMaxPoints) break;
  }
  return {points.begin(), points.end()};
}

}  // namespace romap::slam
