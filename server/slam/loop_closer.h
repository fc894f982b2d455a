#pragma once

#include "server/slam/place_recognizer.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Closes a loop: moves the new end of the map onto the old one, makes the points that both know one, and spreads what
// is left of the error over the pose graph of all keyframes (Strasdat et al. 2010; Mur-Artal et al. 2015, section VII).
// A loop whose ends already lie on each other is only sewn together. Returns whether poses moved.
bool CloseLoop(const LoopMatch& loop, bool fix_scale, const SlamConfig& config, SlamMap& map);

}  // namespace romap::slam
