#pragma once

#include <optional>

#include "server/slam/monocular_initializer.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Creates the first keyframes and points of an empty map. World: the first camera is at the origin; z points up
// according to `frame`'s gravity if the views have depth; else z is opposite to the first camera's y axis. Without
// depth, the median depth of the points in the first view becomes one map unit. Returns the newest keyframe; nullopt if
// large errors remain after bundle adjustment or there are too few points; then the map must be discarded.
std::optional<KeyframeId> InitializeMap(const InitialViews& views, const Frame& frame, const SlamConfig& config,
                                        SlamMap& map);

}  // namespace romap::slam
