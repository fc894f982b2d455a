// Replaces the CUDA back end in builds without nvcc.
#include "server/nerf/cuda/cuda_trainer.h"

namespace romap::nerf::cuda {

absl::Status Supports(const NerfConfig&) { return absl::UnavailableError("CUDA: not compiled into this build"); }

std::unique_ptr<Trainer> MakeCudaTrainer(const NerfConfig&, std::unique_ptr<Trainer> cpu) { return cpu; }

}  // namespace romap::nerf::cuda
