#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "server/nerf/math/types.h"

namespace romap::nerf {

// Input of the training steps, the same for every back end. `ray` must be thread-safe and a pure function of its
// arguments.
struct StepSource {
  std::function<Ray(uint64_t step, int index)> ray;
  std::function<float(uint64_t step)> learning_rate;
  std::function<float(uint64_t step)> progress = {};  // 0..1 of the training plan; only for signed-distance fields
  std::array<float, 3> extent = {1, 1, 1};            // of the box in Unit space
  GridPose grid = {};
};

}  // namespace romap::nerf
