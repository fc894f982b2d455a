// Takes the place of the CUDA back end in builds without nvcc.
#include "server/nerf/cuda/cuda_trainer.h"

namespace romap::nerf::cuda {

absl::StatusOr<std::unique_ptr<Trainer>> MakeCudaTrainer(const NerfConfig&, uint64_t) {
  return absl::UnavailableError("CUDA: this build has no CUDA back end");
}

}  // namespace romap::nerf::cuda
