#pragma once

#include "server/slam/features/feature_extractor.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"
#include "server/slam/tracker.h"

namespace romap::slam {

// Adds a tracked frame to the map as a keyframe and makes new points with it. Not thread-safe.
class KeyframeBuilder {
 public:
  explicit KeyframeBuilder(const SlamConfig& config) : config_(config), extractor_(config) {}

  // `T_world_camera`: the pose of `image` in the current map. `previous`: the keyframe added before, 0 = none; it
  // becomes the parent if the new one shares no points with any other. `use_prior`: the client's pose of the frame is
  // kept as a prior.
  MapKeyframe& Add(const TrackedImage& image, const SE3<World, Camera>& T_world_camera, KeyframeId previous,
                   bool use_prior, SlamMap& map);

 private:
  MapKeyframe& Insert(const TrackedImage& image, const SE3<World, Camera>& T_world_camera, bool use_prior,
                      SlamMap& map);
  void FindPoints(MapKeyframe& keyframe, SlamMap& map) const;
  void MakePoints(MapKeyframe& keyframe, SlamMap& map) const;

  const SlamConfig config_;
  FeatureExtractor extractor_;
};

}  // namespace romap::slam
