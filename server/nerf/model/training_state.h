#pragma once

#include <cstdint>

#include "server/nerf/model/aligned_buffer.h"
#include "server/nerf/model/field_model.h"
#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// All state of a field that training modifies. It is in host memory; a back end that trains on a device copies it to
// the device and back.
struct TrainingState {
  TrainingState(const NerfConfig& config, uint64_t seed)
      : model(config, seed),
        table_first(model.table.size()),
        table_second(model.table.size()),
        mlp_first(model.mlp.parameters.size()),
        mlp_second(model.mlp.parameters.size()) {}

  FieldModel model;
  // First and second moments of Adam, each with the layout of its parameters.
  AlignedBuffer<float> table_first, table_second, mlp_first, mlp_second;
  uint64_t steps_done = 0;
};

}  // namespace romap::nerf
