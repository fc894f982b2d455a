#pragma once

#include <span>

#include "common/stage_messages.h"

namespace romap::nerf {

// The share of the dense depths, all multiplied by `scale`, that other views contradict: put into space, the point lies
// on background of at least one of them, or before what that one measured. Looks at a sample of the object's pixels. 0
// without dense depth.
double MisplacedShare(std::span<const ObjectView> views, double scale);

// Whether the dense depths belong to these views: no other scale makes clearly more of them agree with the masks, and
// most of them do. Holes and outliers are no misfit. True without dense depth.
bool DepthsFit(std::span<const ObjectView> views);

}  // namespace romap::nerf
