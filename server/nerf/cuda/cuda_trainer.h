#pragma once

#include <absl/status/status.h>

#include <memory>

#include "server/nerf/trainer.h"

namespace romap::nerf::cuda {

// Whether fields of this configuration can be trained on the CUDA device. UNAVAILABLE: this build or machine has no
// CUDA, or the device has failed; INVALID_ARGUMENT: the kernels do not support the configuration. The message is one
// line.
absl::Status Supports(const NerfConfig& config);

// Trains the field of `cpu` on the CUDA device, on the stream of the thread that calls Run(). Requires
// Supports(config). If the device fails, it is marked unhealthy, and `cpu` continues from the end of the last Run();
// if the device has too little memory, `cpu` trains instead.
std::unique_ptr<Trainer> MakeCudaTrainer(const NerfConfig& config, std::unique_ptr<Trainer> cpu);

}  // namespace romap::nerf::cuda
