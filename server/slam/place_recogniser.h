#pragma once

#include <optional>
#include <vector>

#include "server/slam/geometry/pnp.h"
#include "server/slam/places/place_index.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap {

// A known place that a keyframe shows again.
struct LoopMatch {
  KeyframeId keyframe;  // the newest one
  KeyframeId place;     // the old one
  Sim3<Camera, Camera> S_place_keyframe;
  std::vector<std::pair<MapPointId, MapPointId>> same_points = {};  // (seen from the new side, known on the old side)
  double disagreement_px = 0;  // median distance of the old points from where the map as it is puts them
};

// Knows places again by their looks and proves it by their geometry.
class PlaceRecogniser {
 public:
  PlaceRecogniser(const SlamConfig& config, const SlamMap* map) : config_(config), map_(map), index_(1) {}

  void Add(const MapKeyframe& keyframe) { index_.Add(keyframe.id, keyframe.features()); }
  void Remove(KeyframeId keyframe) { index_.Remove(keyframe); }

  // Where a frame was taken, and the keyframe that looked like it.
  struct Found {
    PoseEstimate pose;
    KeyframeId place;
  };
  std::optional<Found> FindCamera(const FrameFeatures& sight) const;

  // An old place in what the keyframe sees, far from it in the covisibility graph.
  std::optional<LoopMatch> FindLoop(const MapKeyframe& keyframe, bool fix_scale) const;

 private:
  std::vector<MapPointId> PointsAround(const MapKeyframe& keyframe, size_t neighbours) const;
  std::optional<LoopMatch> Verify(const MapKeyframe& keyframe, const MapKeyframe& place, bool fix_scale) const;

  const SlamConfig config_;
  const SlamMap* const map_;
  PlaceIndex index_;
};

}  // namespace romap
