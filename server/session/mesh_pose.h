#pragma once

#include "common/geometry.h"

namespace romap::session {

// The pose of a mesh in the world at the time of its field snapshot. Meshing takes seconds, during which the map may be
// corrected.
struct MeshPose {
  SE3<World, Object> T_world_mesh;
  Sim3<World, World> S_new_first;  // of the snapshot: the corrections of the object that it includes
};

}  // namespace romap::session
