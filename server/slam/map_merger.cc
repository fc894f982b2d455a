#include "server/slam/map_merger.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "server/slam/map_joint.h"

namespace romap::slam {
namespace {

constexpr size_t kMinAgreeingKeyframes = 3;  // consecutive ones

}  // namespace

void MapMerger::Forget() {
  trial_.Cancel();
  agreeing_.clear();
}

void MapMerger::Reject(const CommonPlace& place) {
  rejected_[place.kept].Add(place.keyframe, place.kept_keyframe);
  ++rejections_;
  Forget();
}

void MapMerger::Observe(const MapKeyframe& keyframe, const MapAtlas& atlas) {
  if (trial_.IsPending() || atlas.kept().empty()) return;
  std::optional<CommonPlace> best;
  for (const auto& kept : atlas.kept()) {
    auto place = FindCommonPlace(keyframe, atlas.current(), *kept, config_);
    if (!place || rejected_[place->kept].Contains(place->keyframe, place->kept_keyframe)) continue;
    if (!best || place->same_points.size() > best->same_points.size()) best = std::move(place);
  }
  if (!best) {
    agreeing_.clear();
    return;
  }
  const SlamMap& kept = atlas.Find(best->kept)->map;
  if (!agreeing_.empty() && !Agree(agreeing_.back(), *best, atlas.current().map, kept)) agreeing_.clear();
  agreeing_.push_back(*std::move(best));
  if (agreeing_.size() >= kMinAgreeingKeyframes) StartTrial(atlas);
}

void MapMerger::StartTrial(const MapAtlas& atlas) {
  const auto place = *std::max_element(agreeing_.begin(), agreeing_.end(), [](const auto& a, const auto& b) {
    return a.same_points.size() < b.same_points.size();
  });
  agreeing_.clear();
  const SessionMap& current = atlas.current();
  const SessionMap& kept = *atlas.Find(place.kept);
  const auto joint = MakeJoint(place, current, kept);
  if (!joint) return;
  if (IsAmbiguous(place, current, kept)) {
    spdlog::info("slam: {} and {} may show a common place, but another place fits as well", current.id.ToString(),
                 kept.id.ToString());
    return Reject(place);
  }
  tried_ = place;
  if (!trial_.Start(*joint, atlas.Find(joint->maps.from)->map, atlas.Find(joint->maps.into)->map)) Reject(place);
}

std::optional<MapMerge> MapMerger::Conclude(bool wait, MapAtlas& atlas) {
  if (!trial_.IsPending()) return std::nullopt;
  const std::optional<bool> confirmed = trial_.Conclude(wait);
  if (!confirmed) return std::nullopt;
  if (!*confirmed) {
    Reject(tried_);
    return std::nullopt;
  }
  const auto joint = MakeJoint(tried_, atlas.current(), *atlas.Find(tried_.kept));
  Forget();
  if (!joint) return std::nullopt;  // a keyframe was redundant; the next ones prove it again
  spdlog::info("slam: {} merged into {}", joint->maps.from.ToString(), joint->maps.into.ToString());
  atlas.Find(joint->maps.from)->map.Transform(joint->S_into_from);
  atlas.Merge(joint->maps);
  ConnectParts(*joint, config_, atlas.Find(joint->maps.into)->map);
  return joint->maps;
}

}  // namespace romap::slam
