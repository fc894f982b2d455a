#pragma once

#include <Eigen/Core>
#include <span>

#include "server/mesh/field_grid.h"

namespace romap {

// Makes empty space solid that is hidden: all nodes at or below `level` that cannot be reached from outside the box by
// steps over the six neighbours through space that is open to sight. A node is open when the optical depth towards some
// view centre (Object frame, map units) is at most `max_optical_depth`, or when the hull has spoken (kEmptyRaw). No
// colour ever told about the rest, so the field's answer there is arbitrary; mostly it is the object's inside or
// underside. Without view centres everything is open, and only closed cavities fill. See SightTester for optical depth.
void FillHiddenSpace(FieldGrid& grid, float level, std::span<const Eigen::Vector3f> view_centers,
                     double max_optical_depth);

}  // namespace romap
