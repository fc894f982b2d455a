#pragma once

#include <optional>
#include <vector>

#include "server/slam/geometry/pnp.h"
#include "server/slam/places/place_index.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// A loop whose ends lie closer together than this, in the newest keyframe's image, has not drifted.
inline constexpr double kNoDrift_px = 4;

// A known place that a keyframe shows again.
struct LoopMatch {
  KeyframeId keyframe;  // the newest one
  KeyframeId place;     // the old one
  Sim3<Camera, Camera> S_place_keyframe = {};
  std::vector<std::pair<MapPointId, MapPointId>> same_points = {};  // (seen from the new side, known on the old side)
  double disagreement_px = 0;  // median distance of the old points from where the map as it is puts them
};

// Knows places again by their looks and proves it by their geometry.
class PlaceRecognizer {
 public:
  PlaceRecognizer(const SlamConfig& config, const SlamMap* map) : config_(config), map_(map), index_(1) {}

  void Add(const MapKeyframe& keyframe) { index_.Add(keyframe.id, keyframe.features()); }
  void Remove(KeyframeId keyframe) { index_.Remove(keyframe); }

  // Where a frame was taken, and the keyframe that looked like it.
  struct Found {
    SE3<World, Camera> T_world_camera;
    KeyframeId place;
  };
  std::optional<Found> FindCamera(const FrameFeatures& frame) const;

  // An old place in what the keyframe sees, that shares hardly any points with it so far.
  std::optional<LoopMatch> FindLoop(const MapKeyframe& keyframe, bool fix_scale) const;

 private:
  // A frame in the part of the map around a place.
  struct Located {
    SE3<World, Camera> T_world_camera;
    std::vector<std::pair<MapPointId, int>> points;  // with the feature that shows each
  };

  std::vector<MapPointId> PointsAround(const MapKeyframe& keyframe, size_t neighbors) const;
  std::optional<Located> Locate(const FrameFeatures& frame, const MapKeyframe& place, uint64_t call) const;
  std::optional<LoopMatch> MakeLoop(const MapKeyframe& keyframe, const MapKeyframe& place, const Located& located,
                                    bool fix_scale) const;

  const SlamConfig config_;
  const SlamMap* const map_;
  PlaceIndex index_;
};

}  // namespace romap::slam
