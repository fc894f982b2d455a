#pragma once

#include "common/stage_messages.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// The message to the later stages about a keyframe that was made from `tracked`, with the points that were removed from
// the map since the last such message.
KeyframeView MakeKeyframeView(const TrackedFrame& tracked, const MapKeyframe& keyframe, SlamMap& map);

}  // namespace romap::slam
