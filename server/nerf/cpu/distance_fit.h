#pragma once

#include <span>

#include "server/nerf/cpu/kernels.h"
#include "server/nerf/model/step_source.h"
#include "server/nerf/model/training_state.h"
#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// Initializes a new signed-distance field by regression to given distances at random cells, so that rays find a surface
// from the first step on. `distance` [kOccupancyResolution^3], x fastest, box sides: at the center of each cell of the
// box in `source`. Cells near the surface are drawn more often.
void FitDistances(const NerfConfig& config, const KernelTable& kernels, const StepSource& source,
                  std::span<const float> distance, TrainingState& field);

}  // namespace romap::nerf
