#pragma once

#include <span>
#include <vector>

#include "server/nerf/math/types.h"
#include "server/nerf/model/field_model.h"
#include "server/nerf/model/render_space.h"
#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// Renders rays on the CPU as in training, but without changing the field. Returns one result per ray, with color_loss
// over a black background. A ray that intersects no occupied cell has opacity 0 and is black.
std::vector<RayResult> RenderRays(const FieldModel& model, const NerfConfig& config, const RenderSpace& space,
                                  std::span<const Ray> rays);

}  // namespace romap::nerf
