#pragma once

#include <optional>

#include "server/slam/monocular_initializer.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Where the world of a map begins.
struct MapStart {
  SE3<World, Camera> T_world_first;  // pose of the first view
  double depth_mu = 1;               // without depth images: median depth of the points in the first view
};

// The start of the first map of a session: the first camera is at the origin; z points up according to `frame`'s
// gravity if the views have depth; else z is opposite to the first camera's y axis.
MapStart FirstMapStart(const InitialViews& views, const Frame& frame);

// The start of a later map, turned so that z points up according to `frame`'s gravity if the views have depth.
MapStart WithGravity(MapStart start, const InitialViews& views, const Frame& frame);

// Creates the first keyframes and points of an empty map. Returns the newest keyframe; nullopt if large errors remain
// after bundle adjustment or there are too few points; then the map must be discarded.
std::optional<KeyframeId> InitializeMap(const InitialViews& views, const MapStart& start, const SlamConfig& config,
                                        SlamMap& map);

}  // namespace romap::slam
