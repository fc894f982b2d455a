#pragma once

#include <vector>

#include "server/slam/local_map.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

LocalPoint MakeLocalPoint(const PointTrack& track);

// Finds known points in a new keyframe and makes new ones. Where poses were given they are exact and points are checked
// strictly against all their observations; where they were estimated, adjustment and culling see to that later.
class PointMaker {
 public:
  PointMaker(const SlamConfig& config, SlamMap* map) : config_(config), map_(map) {}

  // The same for a keyframe that knows few points: looks at more keyframes and takes less parallax, because a map with
  // uncertain points is better than a lost camera.
  static SlamConfig Generous(SlamConfig config);

  // Ties the features of `keyframe` to those of `candidates` that it shows.
  void FindKnownPoints(MapKeyframe& keyframe, const std::vector<MapPointId>& candidates);
  // New points from features of `keyframe` and of `others`, seen from directions that differ enough.
  void MakePointsByParallax(MapKeyframe& keyframe, const std::vector<MapKeyframe*>& others);
  // New points from the depth image.
  void MakePointsByDepth(MapKeyframe& keyframe);
  // Points of `neighbors` and of `keyframe` that turn out to be the same become one.
  void FuseDuplicates(MapKeyframe& keyframe, const std::vector<MapKeyframe*>& neighbors);
  // Earlier keyframes with enough baseline to make points with: those that share most points come first.
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
