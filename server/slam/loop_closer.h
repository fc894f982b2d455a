#pragma once

#include "server/slam/loop_detector.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Closes a loop: moves the newest keyframe and its neighbors (the new side) to their pose relative to the old keyframe
// and its neighbors (the old side), distributes the remaining error over the pose graph of all keyframes (Strasdat et
// al. 2010; Mur-Artal et al. 2015, section VII), and merges the points that both sides have. Without drift
// (kNoDrift_px) it only merges points. Returns whether poses changed.
bool CloseLoop(const LoopMatch& loop, bool fix_scale, const SlamConfig& config, SlamMap& map);

// Merges the points that the newest keyframe and its neighbors have in common with the old one and its neighbors.
// Requires that both sides are aligned.
void FuseSides(const LoopMatch& loop, const SlamConfig& config, SlamMap& map);

}  // namespace romap::slam
