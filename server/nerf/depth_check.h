#pragma once

#include <span>

#include "common/stage_messages.h"

namespace romap::nerf {

// Whether the dense depth of the views is consistent with their masks, on a sample of object pixels. A point from one
// view contradicts another view if it projects to background there, or lies in front of the depth measured there. The
// depth is consistent if most points contradict no view, and no other scale of the depth leaves clearly fewer
// contradictions. Tolerates holes and outliers. True without dense depth.
bool DepthIsConsistent(std::span<const ObjectView> views);

}  // namespace romap::nerf
