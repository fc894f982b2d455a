#pragma once

#include <cstddef>
#include <vector>

#include "server/slam/slam_map.h"

namespace romap::slam {

// The `first` keyframes that share most points with `keyframe`, and for each of them up to `second` of its own
// neighbors. If no keyframe shares enough points, the parent takes the place of the first neighbor.
std::vector<KeyframeId> Neighborhood(const SlamMap& map, const MapKeyframe& keyframe, size_t first, size_t second);

// The points that the keyframes observe, in the order of their ids. Stops after the keyframe that exceeds 8000 points,
// which bounds the time that tracking spends on them.
std::vector<MapPointId> PointsOf(const SlamMap& map, const std::vector<KeyframeId>& keyframes);

}  // namespace romap::slam
