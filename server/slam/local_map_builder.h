#pragma once

#include <memory>
#include <optional>

#include "server/slam/local_map.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// The part of the map around the keyframe `reference`, for tracking. Without such a keyframe it has no points.
std::shared_ptr<const LocalMap> MakeLocalMap(const SlamMap& map, KeyframeId reference, int generation,
                                             const std::optional<LocalMap::Relocalization>& relocalized);

}  // namespace romap::slam
