#pragma once

#include <optional>

#include "server/mesh/field_grid.h"
#include "server/mesh/visibility.h"

namespace romap::mesh {

// Height (z in the Object frame, map units) at which the object ends: of the lowest part of the surface that is visible
// from the front in some view; a small share of the visible area below it is ignored as noise. nullopt if the views
// observe no walls, because only the lower end of a wall defines the base.
//
// Cameras mostly view an object from above. Neither masks nor colors then show its lower end, and hidden space extends
// down to the bottom of the box. The views do show the support around the object, and the visible surface of the object
// ends at the height of the support.
//
// A round bottom turns away from the views above the support. If the normals of the lowest visible part turn downward
// with the height, as on a sphere, the base is where they would point straight down.
//
// `visibility` may have been made before hidden space was filled, because invisible nodes do not hide visible ones.
std::optional<float> FindVisibleBase(const FieldGrid& grid, VisibilityTester& visibility);

// Empties all nodes below `height`, so that the surface is closed by a flat face at that height.
void CutBelow(FieldGrid& grid, float height);

}  // namespace romap::mesh
