#pragma once

#include "common/field_snapshot.h"
#include "server/nerf/model/field_model.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/training_box.h"

namespace romap::nerf {

// Fills in what the raw values of a field mean: surface_level, optics and connect_level of its snapshot.
void DescribeSurface(const NerfConfig& config, const nerf::FieldModel& model, const TrainingBox& box,
                     FieldSnapshot& snapshot);

}  // namespace romap::nerf
