#pragma once

#include <cstddef>
#include <vector>

#include "server/slam/slam_map.h"

namespace romap::slam {

// The neighbors of `keyframe`: up to `max_neighbors` keyframes that share most points with it, then up to
// `max_second_neighbors` neighbors of each of these. If no keyframe shares enough points (kMinSharedPoints), the parent
// is the only neighbor.
std::vector<KeyframeId> Neighborhood(const SlamMap& map, const MapKeyframe& keyframe, size_t max_neighbors,
                                     size_t max_second_neighbors);

// The points that the keyframes observe, in the order of their ids. Stops after the keyframe that increases their
// number beyond 8000, to limit the cost of tracking.
std::vector<MapPointId> PointsOf(const SlamMap& map, const std::vector<KeyframeId>& keyframes);

}  // namespace romap::slam
