#pragma once

#include <vector>

#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Points whose trial is over without enough observations, and beyond the allowed number those seen longest ago.
void CullPoints(const SlamConfig& config, SlamMap& map);

// Takes out keyframes around `newest` that say nothing new: nearly all of their points are seen by several others as
// well or better (Mur-Artal et al. 2015, section VI-E). Returns those that went.
std::vector<KeyframeId> CullKeyframes(const SlamConfig& config, const MapKeyframe& newest, SlamMap& map);

}  // namespace romap::slam
