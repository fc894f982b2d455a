#pragma once

#include <span>

#include "server/nerf/cpu/field_trainer.h"

namespace romap::nerf {

// Teaches a new signed-distance field given distances, by regression at random cells: a start from which rays find the
// surface. `distance` [kOccupancyResolution^3], x fastest, box sides: at the middle of each cell of the box that
// `source` tells of. What lies far from the surface counts for little.
void FitDistances(const NerfConfig& config, const KernelTable& kernels, const StepSource& source,
                  std::span<const float> distance, FieldTrainer::State field);

}  // namespace romap::nerf
