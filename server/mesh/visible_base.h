#pragma once

#include <optional>

#include "server/mesh/field_grid.h"
#include "server/mesh/visibility.h"

namespace romap::mesh {

// Height (z in the Object frame, map units) of the lowest part of the surface that some view sees from the front; a
// small share of the visible area below it is ignored as noise. nullopt if the views see no walls, whose lower end this
// height could be.
//
// Cameras mostly look down on an object, so that neither masks nor colors show where it ends below, and hidden space
// extends down to the bottom of the box. But the views show the support around the object, and the visible surface of
// the object ends at that height.
//
// `visibility` may be older than the filling of hidden space, because invisible nodes hide nothing else.
std::optional<float> FindVisibleBase(const FieldGrid& grid, VisibilityTester& visibility);

// Ends all matter below `height` in a flat face at that height.
void CutBelow(FieldGrid& grid, float height);

}  // namespace romap::mesh
