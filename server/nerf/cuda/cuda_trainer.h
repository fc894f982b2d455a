#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>

#include "server/nerf/trainer.h"

namespace romap::nerf::cuda {

// A new field that is trained on the CUDA device, on the stream of the thread that calls Run(). Should the device fail,
// it is marked unhealthy and the field goes on on the CPU from where the last Run() left it; while it has too little
// memory, the CPU stands in. UNAVAILABLE, in one line: this build or machine has no CUDA, or the device failed before.
// INVALID_ARGUMENT: a field that the kernels cannot hold.
absl::StatusOr<std::unique_ptr<Trainer>> MakeCudaTrainer(const NerfConfig& config, uint64_t seed);

}  // namespace romap::nerf::cuda
