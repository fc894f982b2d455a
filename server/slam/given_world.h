#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/map_events.h"
#include "server/slam/geometry/world_alignment.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Moves a map that was started from images into the client's world, once the client's poses of keyframes determine the
// similarity between the two. Poses that do not agree with the map are refused.
class GivenWorld {
 public:
  // The client's pose of a keyframe of the map.
  void Observe(KeyframeId keyframe, const SE3<World, Camera>& T_world_camera);
  // The motion of the map into the client's world. nullopt: there are no new poses, or they do not determine it.
  // Call it after Observe(); not again after it returned a motion. `scale_is_known`: the map is in meters.
  std::optional<Sim3<World, World>> ProposeMotion(const SlamMap& map, bool scale_is_known);
  // Why given poses are ignored; empty if there are none.
  std::vector<Diagnostic> Diagnostics() const;

 private:
  std::deque<std::pair<KeyframeId, SE3<World, Camera>>> poses_;  // the newest ones
  std::string reason_;                                           // the motion is not determined
  bool has_new_ = false;
};

}  // namespace romap::slam
