#pragma once

#include <vector>

#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Removes points that have too few observations after their first keyframes and, beyond the maximum number of points,
// those not observed for the longest time.
void CullPoints(const SlamConfig& config, SlamMap& map);

// Removes redundant keyframes around `newest`: several others observe nearly all of their points equally well or better
// (Mur-Artal et al. 2015, section VI-E). Returns the removed ones.
std::vector<KeyframeId> CullKeyframes(const SlamConfig& config, const MapKeyframe& newest, SlamMap& map);

}  // namespace romap::slam
