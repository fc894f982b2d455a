#pragma once

#include <array>
#include <cstdint>

#include "server/nerf/math/types.h"

namespace romap::nerf {

// The space in which a field is rendered. Training takes the same values from its StepSource and Occupancy.
struct RenderSpace {
  const uint32_t* occupied_bits = nullptr;  // see Occupancy::bits
  std::array<float, 3> extent = {1, 1, 1};  // of the box in Unit space
  GridPose grid = {};
};

}  // namespace romap::nerf
