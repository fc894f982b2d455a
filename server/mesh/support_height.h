#pragma once

#include <optional>

#include "server/mesh/field_grid.h"
#include "server/mesh/sight_tester.h"

namespace romap::mesh {

// Height (z in the Object frame, map units) of the lowest part of the surface that some view sees from the front, with
// a small share of the visible area allowed below it for noise. nullopt: the views see no walls that could end
// somewhere.
//
// Cameras mostly look down on an object, so neither masks nor colours tell where it ends below: hidden space reaches
// down to the bottom of the box. But what carries the object was seen around it, and where that begins the visible
// surface ends.
//
// `sight` may have been made before hidden space was filled: what no view sees hides nothing else from any.
std::optional<float> FindSupportHeight(const FieldGrid& grid, SightTester& sight);

// Ends all matter below `height` in a flat face at that height.
void CutBelow(FieldGrid& grid, float height);

}  // namespace romap::mesh
