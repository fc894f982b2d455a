#pragma once

#include "server/mesh/field_grid.h"
#include "server/mesh/visibility.h"

namespace romap::mesh {

// Makes hidden empty space solid: all nodes outside the surface that cannot be reached from outside the box over six
// neighbors through open nodes. A node is open if it is visible from some view, or certainly empty (kEmpty). No
// training pixel constrains the field in hidden space, so its values there are arbitrary; most of it is inside the
// object or below it. `visibility` must have been made from this grid; without views every node is open, and only
// closed cavities are filled.
void FillHiddenSpace(FieldGrid& grid, VisibilityTester& visibility);

}  // namespace romap::mesh
