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
  // The client's pose of a tracked frame. `reference`, `T_reference_camera`: its pose in the map, see TrackedFrame. If
  // the client sends many poses, those of keyframes suffice.
  void Observe(int64_t timestamp_ns, KeyframeId reference, const SE3<Camera, Camera>& T_reference_camera,
               const SE3<World, Camera>& T_world_camera);
  // Whether no pose was observed shortly before: then also that of a frame that is no keyframe is useful.
  bool NeedsPoseAt(int64_t timestamp_ns) const;
  // The motion of the map into the client's world. nullopt: there are no new poses, or they do not determine it.
  // Call it after Observe(); not again after it returned a motion. `scale_is_known`: the map is in meters.
  std::optional<Sim3<World, World>> ProposeMotion(const SlamMap& map, bool scale_is_known);
  // Why given poses are ignored; empty if there are none.
  std::vector<Diagnostic> Diagnostics() const;

 private:
  struct GivenPose {
    int64_t timestamp_ns;
    KeyframeId reference;
    SE3<Camera, Camera> T_reference_camera;
    SE3<World, Camera> T_world_camera;
  };

  std::deque<GivenPose> poses_;  // the newest ones
  std::string reason_;           // the motion is not determined
  bool has_new_ = false;
};

}  // namespace romap::slam
