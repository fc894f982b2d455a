#include "server/objects/point_registry.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <utility>

namespace romap::objects {

size_t PointRegistry::IndexOf(MapPointId point) const {
  const auto entry = std::lower_bound(points_.begin(), points_.end(), point,
                                      [](const Entry& e, const MapPointId& id) { return e.id < id; });
  const bool found = entry != points_.end() && entry->id == point;
  return found ? static_cast<size_t>(entry - points_.begin()) : points_.size();
}

void PointRegistry::UpdatePositions(const KeyframeView& view) {
  std::set<MapPointId> removed(view.removed_points.begin(), view.removed_points.end());
  std::map<MapPointId, Eigen::Vector3d> added;
  for (const MapPoint& point : view.points) {
    if (!point.position_world.allFinite()) {
      removed.insert(point.id);
      added.erase(point.id);
      continue;
    }
    const size_t index = removed.contains(point.id) ? points_.size() : IndexOf(point.id);
    if (index < points_.size()) {
      points_[index].position_world = point.position_world;
    } else {
      added[point.id] = point.position_world;
    }
  }
  if (!removed.empty()) std::erase_if(points_, [&](const Entry& entry) { return removed.contains(entry.id); });
  const auto old_count = static_cast<std::ptrdiff_t>(points_.size());
  for (const auto& [id, position_world] : added) {
    points_.push_back({.id = id, .position_world = position_world, .votes = {}, .owner = {}});
  }
  std::inplace_merge(points_.begin(), points_.begin() + old_count, points_.end(),
                     [](const Entry& a, const Entry& b) { return a.id < b.id; });
}

void PointRegistry::MovePoints(const std::vector<MapPoint>& points) {
  for (const MapPoint& point : points) {
    const size_t index = IndexOf(point.id);
    if (index < points_.size() && point.position_world.allFinite()) {
      points_[index].position_world = point.position_world;
    }
  }
}

void PointRegistry::Append(PointRegistry other) {
  const auto old_count = static_cast<std::ptrdiff_t>(points_.size());
  std::move(other.points_.begin(), other.points_.end(), std::back_inserter(points_));
  std::inplace_merge(points_.begin(), points_.begin() + old_count, points_.end(),
                     [](const Entry& a, const Entry& b) { return a.id < b.id; });
}

// The owner has a clear majority of the votes; those for the background and for the outline count together. A point of
// the background is near masks in some views and clear of them in others, whereas a point on the outline of an object
// is near its mask in nearly all views.
void PointRegistry::UpdateOwner(Entry* entry) {
  constexpr double kClearMajority = 0.6;  // share of the votes
  int background = 0;
  int outline = 0;
  int total = 0;
  std::pair<LandmarkKey, int> best{kBackgroundKey, 0};
  for (const auto& vote : entry->votes) {
    total += vote.second;
    if (vote.first == kBackgroundKey) {
      background = vote.second;
    } else if (vote.first == kOutlineKey) {
      outline = vote.second;
    } else if (vote.second > best.second) {
      best = vote;
    }
  }
  entry->owner.reset();
  if (total == 0) return;
  if (best.second >= kClearMajority * total) {
    entry->owner = best.first;
  } else if (background + outline >= kClearMajority * total) {
    entry->owner = background >= outline ? kBackgroundKey : kOutlineKey;
  }
}

void PointRegistry::Vote(MapPointId point, LandmarkKey key) {
  const size_t index = IndexOf(point);
  if (index == points_.size()) return;
  auto& votes = points_[index].votes;
  auto vote = std::find_if(votes.begin(), votes.end(), [&](const auto& v) { return v.first == key; });
  if (vote == votes.end()) vote = votes.insert(votes.end(), {key, 0});
  ++vote->second;
  // Halving old votes lets a point recover from early wrong ones.
  constexpr int kMaxVotes = 24;  // per owner
  if (vote->second >= kMaxVotes) {
    for (auto& [owner, count] : votes) count /= 2;
  }
  UpdateOwner(&points_[index]);
}

void PointRegistry::Merge(LandmarkKey from, LandmarkKey into) {
  for (Entry& entry : points_) {
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
    UpdateOwner(&entry);
  }
}

const Eigen::Vector3d* PointRegistry::Find(MapPointId point) const {
  const size_t index = IndexOf(point);
  return index == points_.size() ? nullptr : &points_[index].position_world;
}

std::map<LandmarkKey, std::vector<PointRegistry::Member>> PointRegistry::GroupByOwner() const {
  std::map<LandmarkKey, std::vector<Member>> groups;
  for (const Entry& entry : points_) {
    if (entry.owner) groups[*entry.owner].push_back({entry.id, entry.position_world});
  }
  return groups;
}

}  // namespace romap::objects
