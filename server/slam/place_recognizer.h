#pragma once

#include <optional>
#include <vector>

#include "server/slam/geometry/pnp.h"
#include "server/slam/places/place_index.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// A loop with less drift than this in the newest keyframe's image needs no correction.
inline constexpr double kNoDrift_px = 4;

// A keyframe and an old keyframe that show the same place.
struct LoopMatch {
  KeyframeId newest;
  KeyframeId old;
  Sim3<Camera, Camera> S_old_newest = {};
  std::vector<std::pair<MapPointId, MapPointId>> same_points = {};  // (point of the new side, point of the old side)
  double drift_px = 0;  // median distance in the newest image between features and projections of the old points
};

// Place recognition: finds keyframes by their descriptors and verifies them geometrically.
class PlaceRecognizer {
 public:
  PlaceRecognizer(const SlamConfig& config, const SlamMap* map) : config_(config), map_(map), index_(1) {}

  void Add(const MapKeyframe& keyframe) { index_.Add(keyframe.id, keyframe.features()); }
  void Remove(KeyframeId keyframe) { index_.Remove(keyframe); }

  struct Relocalized {
    SE3<World, Camera> T_world_camera;
    KeyframeId keyframe;  // shows the same place
  };
  // Finds the pose of a frame without a prior.
  std::optional<Relocalized> Relocalize(const FrameFeatures& frame) const;

  // Finds an old keyframe that shows the same place but shares few or no points with this one. `fix_scale`: the map's
  // scale does not drift.
  std::optional<LoopMatch> FindLoop(const MapKeyframe& keyframe, bool fix_scale) const;

 private:
  // The pose of a frame in the part of the map around a keyframe.
  struct Located {
    SE3<World, Camera> T_world_camera;
    std::vector<std::pair<MapPointId, int>> points;  // with the feature that observes each
  };

  std::vector<MapPointId> PointsAround(const MapKeyframe& keyframe, size_t neighbors) const;
  std::optional<Located> Locate(const FrameFeatures& frame, const MapKeyframe& around, uint64_t call) const;
  std::optional<LoopMatch> MakeLoop(const MapKeyframe& keyframe, const MapKeyframe& old, const Located& located,
                                    bool fix_scale) const;

  const SlamConfig config_;
  const SlamMap* const map_;
  PlaceIndex index_;
};

}  // namespace romap::slam
