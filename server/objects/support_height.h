#pragma once

#include <optional>

#include "server/objects/cuboid_fitter.h"

namespace romap::objects {

// Height (z in the Grid frame of the evidence) of the horizontal surface that the object stands on: the top of another
// object below it, otherwise the densest thin layer of background points around its footprint, otherwise the median
// bottom of its neighbors. `mask_base` (see FindMaskBase()): a surface that is clearly above it is not the support,
// because the object reaches below that surface; and the bottoms of neighbors count only near it. nullopt without any
// evidence.
std::optional<double> FindSupportHeight(const CuboidEvidence& evidence, std::optional<double> mask_base);

}  // namespace romap::objects
