#pragma once

#include <optional>

#include "server/objects/cuboid_fitter.h"
#include "server/objects/mask_base.h"

namespace romap::objects {

// Height (z in the Grid frame of the evidence) of the horizontal surface that the object stands on: the top of another
// object below it, otherwise the densest thin layer of background points around its footprint, otherwise the median
// bottom of its neighbors. `mask_base`: a surface that is clearly above its bound is not the support,
// because the object reaches below that surface; and the bottoms of neighbors count only near its bottom. nullopt
// without any evidence.
std::optional<double> FindSupportHeight(const CuboidEvidence& evidence, const std::optional<MaskBase>& mask_base);

}  // namespace romap::objects
