#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "server/slam/session_map.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// A keyframe of the current map and a keyframe of a kept map that show the same place.
struct CommonPlace {
  SparseMapId kept;
  KeyframeId keyframe;                       // of the current map
  KeyframeId kept_keyframe;                  // of the kept map
  Sim3<Camera, Camera> S_kept_current = {};  // from the camera of `keyframe` to that of `kept_keyframe`; with the scale
  std::vector<std::pair<MapPointId, MapPointId>> same_points = {};  // (of the current map, of the kept map)
  double depth_mu = 0;                                              // median, in the unit of the kept map

  // The motion of the world of the current map into that of the kept one. nullopt: a keyframe was removed.
  std::optional<Sim3<World, World>> Alignment(const SlamMap& current, const SlamMap& kept_map) const;
};

// Whether the scales of two maps are known to be equal.
bool HaveSameScale(const SessionMap& a, const SessionMap& b);

// Searches a kept map for the place that a keyframe of the current map shows: by descriptors and P3P (PlaceRecognizer),
// then the similarity between the two maps from the points that both have (SolveSimilarity). nullopt: there is none,
// different places of the kept map fit, or only a part of the image fits.
std::optional<CommonPlace> FindCommonPlace(const MapKeyframe& keyframe, const SessionMap& current,
                                           const SessionMap& kept, const SlamConfig& config);

// Whether both are about the same similarity between the same two maps.
bool Agree(const CommonPlace& a, const CommonPlace& b, const SlamMap& current, const SlamMap& kept);

// Whether the kept keyframe also fits a place of the current map other than the common one. Repeated texture makes
// places look alike, so that the common place is no proof then.
bool IsAmbiguous(const CommonPlace& place, const SessionMap& current, const SessionMap& kept);

}  // namespace romap::slam
