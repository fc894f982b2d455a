#pragma once

#include "common/cuboid.h"
#include "common/geometry.h"
#include "common/stage_messages.h"

namespace romap {

// Motion of values with the space around them, p_new = S_new_old * p_old, after a correction of the map.

// Moves and scales the cuboid. It is no longer upright if the correction changed the up direction.
Cuboid Moved(const Sim3<World, World>& S_new_old, Cuboid cuboid);

// Moves the camera and scales its depths, so that the view stays consistent with an object that was moved equally.
// The pixels stay shared; the depth image is shared unless the scale changes.
ObjectView Moved(const Sim3<World, World>& S_new_old, ObjectView view);

}  // namespace romap
