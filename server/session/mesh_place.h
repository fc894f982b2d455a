#pragma once

#include "common/geometry.h"

namespace romap::session {

// Where the mesh of a field snapshot stands, in the world as it was when the snapshot was taken. Meshing takes a while;
// the map may be corrected meanwhile.
struct MeshPlace {
  SE3<World, Object> T_world_mesh;
  Sim3<World, World> S_new_first;  // of the snapshot: the corrections of the object it knows of
};

}  // namespace romap::session
