#pragma once

#include "common/cuboid.h"
#include "common/geometry.h"
#include "common/stage_messages.h"

namespace romap {

// How what was handed on follows a correction of the map: the space it stands in underwent `S_new_old`.

// The box goes along and grows with the space. It leans when the space was turned against up.
Cuboid Moved(const Sim3<World, World>& S_new_old, Cuboid cuboid);

// The camera goes along and its depths grow with the space, so that nothing changes between the view and an object that
// moves in the same way. The pixels stay shared; depth images are shared unless the scale changes.
ObjectView Moved(const Sim3<World, World>& S_new_old, ObjectView view);

}  // namespace romap
