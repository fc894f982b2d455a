#pragma once

#include <vector>

#include "server/slam/local_map.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

LocalPoint MakeLocalPoint(const PointTrack& track);

// Finds known points in a new keyframe and makes new ones. Given poses are exact, so points are immediately checked
// against all their observations. With estimated poses, bundle adjustment and culling remove bad observations later.
class PointMaker {
 public:
  PointMaker(const SlamConfig& config, SlamMap* map) : config_(config), map_(map) {}

  // The configuration for a keyframe with few points: matches more keyframes and accepts less parallax, because
  // uncertain points are better than a loss of tracking.
  static SlamConfig RelaxedConfig(SlamConfig config);

  // Adds observations of those `candidates` that are found in the keyframe.
  void FindKnownPoints(MapKeyframe& keyframe, const std::vector<MapPointId>& candidates);
  // New points from features of `keyframe` and of `others`, with enough parallax.
  void MakePointsByParallax(MapKeyframe& keyframe, const std::vector<MapKeyframe*>& others);
  // New points from the depth image.
  void MakePointsByDepth(MapKeyframe& keyframe);
  // Merges map points of `neighbors` and of `keyframe` that are the same point of the scene.
  void FuseDuplicates(MapKeyframe& keyframe, const std::vector<MapKeyframe*>& neighbors);
  // Earlier keyframes with enough baseline for new points, those that share most points first.
  std::vector<MapKeyframe*> KeyframesToMatch(const MapKeyframe& keyframe) const;

 private:
  // Adds the observation if it agrees with the point. Returns whether it was added.
  bool Associate(MapKeyframe& keyframe, int feature, PointTrack& track);
  PointTrack* MakePoint(MapKeyframe& keyframe, int feature, MapKeyframe& other, int other_feature);
  std::optional<int> FindFreeFeature(const PointTrack& track, const MapKeyframe& keyframe) const;
  // Adds observations of `points` in the keyframe, or merges them with the points that it observes there.
  void FuseInto(MapKeyframe& keyframe, const std::vector<MapPointId>& points);

  const SlamConfig config_;
  SlamMap* const map_;
};

}  // namespace romap::slam
