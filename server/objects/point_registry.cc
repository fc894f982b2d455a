#include "server/objects/point_registry.h"

#include <algorithm>

namespace romap {

void PointRegistry::UpdatePositions(const KeyframeView& view) {
  for (const MapPointId& id : view.removed_points) points_.erase(id);
  for (const MapPoint& point : view.points) {
    if (point.position_world.allFinite()) {
      points_[point.id].position_world = point.position_world;
    } else {
      points_.erase(point.id);
    }
  }
}

void PointRegistry::MovePoints(const std::vector<MapPoint>& points) {
  for (const MapPoint& point : points) {
    const auto entry = points_.find(point.id);
    if (entry != points_.end() && point.position_world.allFinite()) {
      entry->second.position_world = point.position_world;
    }
  }
}

void PointRegistry::Vote(MapPointId point, LandmarkKey key) {
  const auto entry = points_.find(point);
  if (entry == points_.end()) return;
  auto& votes = entry->second.votes;
  auto vote = std::find_if(votes.begin(), votes.end(), [&](const auto& v) { return v.first == key; });
  if (vote == votes.end()) vote = votes.insert(votes.end(), {key, 0});
  ++vote->second;
  // Old votes fade, so that an early mix-up does not rule for ever.
  constexpr int kFullVotes = 24;
  if (vote->second < kFullVotes) return;
  for (auto& [owner, count] : votes) count /= 2;
}

void PointRegistry::Merge(LandmarkKey from, LandmarkKey into) {
  for (auto& [id, entry] : points_) {
    const auto source =
        std::find_if(entry.votes.begin(), entry.votes.end(), [&](const auto& v) { return v.first == from; });
    if (source == entry.votes.end()) continue;
    const int count = source->second;
    entry.votes.erase(source);
    const auto target =
        std::find_if(entry.votes.begin(), entry.votes.end(), [&](const auto& v) { return v.first == into; });
    if (target == entry.votes.end()) {
      entry.votes.emplace_back(into, count);
    } else {
      target->second += count;
    }
  }
}

const Eigen::Vector3d* PointRegistry::Find(MapPointId point) const {
  const auto entry = points_.find(point);
  return entry == points_.end() ? nullptr : &entry->second.position_world;
}

std::map<LandmarkKey, std::vector<PointRegistry::Member>> PointRegistry::GroupByOwner() const {
  constexpr double kClearMajority = 0.6;
  std::map<LandmarkKey, std::vector<Member>> groups;
  for (const auto& [id, entry] : points_) {
    int total = 0;
    std::pair<LandmarkKey, int> best{kBackgroundKey, 0};
    for (const auto& vote : entry.votes) {
      total += vote.second;
      if (vote.second > best.second) best = vote;
    }
    if (total > 0 && best.second >= kClearMajority * total) groups[best.first].push_back({id, entry.position_world});
  }
  return groups;
}

}  // namespace romap
