#pragma once

#include <array>
#include <span>
#include <vector>

#include "server/nerf/cpu/kernels.h"
#include "server/nerf/model/field_model.h"
#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// The space in which a field is rendered. Training takes these values from its StepSource and Occupancy.
struct RenderSpace {
  const uint32_t* occupied_bits = nullptr;  // see SamplingRule
  std::array<float, 3> extent = {1, 1, 1};
  GridPose grid = {};
};

// Renders rays as in training, but without changing the field. Returns one result per ray, with color_loss over a black
// background. A ray that meets no occupied cell has opacity 0 and is black.
std::vector<RayResult> RenderRays(const FieldModel& model, const NerfConfig& config, const RenderSpace& space,
                                  std::span<const Ray> rays);

}  // namespace romap::nerf
