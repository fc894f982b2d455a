#pragma once

#include "server/nerf/math/loss_weights.h"
#include "server/nerf/math/occupancy_rules.h"
#include "server/nerf/math/sample_budget.h"
#include "server/nerf/math/types.h"
#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// The parameters of a training step that come from the configuration. All back ends use them.

LossWeights MakeLossWeights(const NerfConfig& config);
ShapeWeights MakeShapeWeights(const NerfConfig& config);
SampleBudget MakeSampleBudget(const NerfConfig& config);
OccupancyPlan MakeOccupancyPlan(const NerfConfig& config);
AdamRates MakeAdamRates(const NerfConfig& config, float learning_rate);

}  // namespace romap::nerf
