#pragma once

#include "common/field_snapshot.h"
#include "server/nerf/model/field_model.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/training_box.h"

namespace romap::nerf {

// Sets surface_level, optics and connect_level of the snapshot of a field.
void DescribeSurface(const NerfConfig& config, const FieldModel& model, const TrainingBox& box,
                     FieldSnapshot& snapshot);

}  // namespace romap::nerf
