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

  // Inserts the frame with the features and points it was tracked by. `T_world_camera`: the pose of `image` in the
  // current map. `previous`: the keyframe added before, 0 = none; it is the parent until Complete(). `use_prior`: the
  // client's pose of the frame is kept as a prior.
  MapKeyframe& Insert(const TrackedImage& image, const SE3<World, Camera>& T_world_camera, KeyframeId previous,
                      bool use_prior, SlamMap& map) const;
  // Makes points with the newest keyframes alone, in a fraction of the time of Complete().
  void MakeFirstPoints(MapKeyframe& keyframe, SlamMap& map) const;
  // Adds the features on objects, finds known points, and makes new ones. The keyframe it shares most points with
  // becomes the parent.
  void Complete(const TrackedImage& image, MapKeyframe& keyframe, SlamMap& map);

 private:
  void AddObjectFeatures(const TrackedImage& image, MapKeyframe& keyframe);
  void FindPoints(MapKeyframe& keyframe, SlamMap& map) const;
  void MakePoints(MapKeyframe& keyframe, SlamMap& map) const;

  const SlamConfig config_;
  FeatureExtractor extractor_;
};

}  // namespace romap::slam
