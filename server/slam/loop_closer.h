#pragma once

#include "server/slam/place_recognizer.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Closes a loop: moves the new side of the map onto the old one, distributes the remaining error over the pose graph of
// all keyframes (Strasdat et al. 2010; Mur-Artal et al. 2015, section VII), and merges the points that both sides have.
// Without drift (kNoDrift_px) it only merges points. Returns whether poses moved.
bool CloseLoop(const LoopMatch& loop, bool fix_scale, const SlamConfig& config, SlamMap& map);

}  // namespace romap::slam
