#pragma once

#include "server/mesh/field_grid.h"
#include "server/mesh/sight_tester.h"

namespace romap::mesh {

// Makes empty space solid that is hidden: all nodes outside the surface that cannot be reached from outside the box by
// steps over the six neighbours through space that is open to sight. A node is open when the optical depth towards some
// view is within the limits, or when the hull has spoken (kEmpty). No colour ever told about the rest, so the field's
// answer there is arbitrary; mostly it is the object's inside or underside. `sight` must have been made of this grid;
// without views everything is open, and only closed cavities fill.
void FillHiddenSpace(FieldGrid& grid, SightTester& sight);

}  // namespace romap::mesh
