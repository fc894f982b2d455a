#pragma once

#include <memory>

#include "server/slam/local_map.h"
#include "server/slam/session_map.h"

namespace romap::slam {

// The part of the map around its keyframe `reference`, for tracking. Without such a keyframe it has no points.
std::shared_ptr<const LocalMap> MakeLocalMap(const SessionMap& session_map, int generation);

}  // namespace romap::slam
