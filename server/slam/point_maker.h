#pragma once

#include <vector>

#include "server/slam/local_map.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

LocalPoint MakeLocalPoint(const PointTrack& track);

// Finds known points in a new keyframe and makes new ones. Given poses are exact, so points are checked against all
// their observations immediately. With estimated poses, bundle adjustment and culling remove bad observations later.
class PointMaker {
 public:
  PointMaker(const SlamConfig& config, SlamMap* map) : config_(config), map_(map) {}

  // The configuration for a keyframe with few points: matches more keyframes and accepts less parallax, because
  // uncertain points are better than losing track.
  static SlamConfig Generous(SlamConfig config);

  // Adds observations of those `candidates` that are found in the keyframe.
  void FindKnownPoints(MapKeyframe& keyframe, const std::vector<MapPointId>& candidates);
  // New points from features of `keyframe` and of `others`, with enough parallax.
  void MakePointsByParallax(MapKeyframe& keyframe, const std::vector<MapKeyframe*>& others);
  // New points from the depth image.
  void MakePointsByDepth(MapKeyframe& keyframe);
  // Merges points of `neighbors` and of `keyframe` that are the same.
  void FuseDuplicates(MapKeyframe& keyframe, const std::vector<MapKeyframe*>& neighbors);
  // Earlier keyframes with enough baseline for new points, those that share most points first.
  std::vector<MapKeyframe*> KeyframesToMatch(const MapKeyframe& keyframe) const;

 private:
  bool Tie(MapKeyframe& keyframe, int feature, PointTrack& track);
  PointTrack* MakePoint(MapKeyframe& keyframe, int feature, MapKeyframe& other, int other_feature);
  std::optional<int> FindFreeFeature(const PointTrack& track, const MapKeyframe& keyframe) const;
  int FuseInto(MapKeyframe& keyframe, const std::vector<MapPointId>& points);

  const SlamConfig config_;
  SlamMap* const map_;
};

}  // namespace romap::slam
