#pragma once

#include <Eigen/Core>
#include <span>

#include "server/mesh/field_grid.h"

namespace romap {

// Makes nodes at or below `level` solid when the optical depth towards every view centre (Object frame, map units)
// exceeds `max_optical_depth`: no colour ever spoke about that space, so the field's answer there is arbitrary, and it
// is mostly the underside or the inside of the object. Nodes above `level` block all sight; below, density is exp(raw)
// per longest box side. Empty nodes (kEmptyRaw) stay empty: the hull has spoken. Does nothing without view centres.
void FillUnseenSpace(FieldGrid& grid, float level, std::span<const Eigen::Vector3f> view_centers,
                     double max_optical_depth);

}  // namespace romap
