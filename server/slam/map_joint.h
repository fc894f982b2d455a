#pragma once

#include <optional>

#include "common/stage_messages.h"
#include "server/slam/common_place.h"
#include "server/slam/loop_detector.h"
#include "server/slam/session_map.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// How two maps with a common place become one: `from` moves into the world of `into`.
struct MapJoint {
  MapMerge maps;
  Sim3<World, World> S_into_from;
  LoopMatch seam;  // the common place, with the keyframe of `from` as the newest one
};

// The map with more keyframes stays in its world. If only one of them has depth images, that one stays and defines the
// scale. nullopt: a keyframe of the common place was removed.
std::optional<MapJoint> MakeJoint(const CommonPlace& place, const SessionMap& current, const SessionMap& kept);

// Connects the two parts of a map to which the keyframes and points of `from` were just added, in the world of `into`:
// the keyframes become one tree, and points that are the same are merged.
void ConnectParts(const MapJoint& joint, const SlamConfig& config, SlamMap& map);

}  // namespace romap::slam
