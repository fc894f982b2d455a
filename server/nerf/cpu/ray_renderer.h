#pragma once

#include <array>
#include <span>
#include <vector>

#include "server/nerf/cpu/field_model.h"
#include "server/nerf/cpu/kernels.h"
#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// Where a field is rendered: the same that training takes from its StepSource and Occupancy.
struct RenderSpace {
  const uint32_t* occupied_bits = nullptr;  // see SamplingRule
  std::array<float, 3> extent = {1, 1, 1};
  GridPose grid = {};
};

// Renders rays as training does, without learning. One result per ray; a ray that meets nothing occupied has opacity 0
// and shows black.
std::vector<RayResult> RenderRays(const FieldModel& model, const NerfConfig& config, const RenderSpace& space,
                                  std::span<const Ray> rays);

}  // namespace romap::nerf
