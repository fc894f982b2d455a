// The CUDA back end compiled as host code; it replaces the back end of the library. The first header provides the parts
// of CUDA that it uses.
// clang-format off
#include "tests/support/cuda_on_host/cuda_on_host.h"

#include "server/nerf/cuda/step_kernel.cu"
#include "server/nerf/cuda/optimize_kernels.cu"
#include "server/nerf/cuda/cuda_field.cc"
#include "server/nerf/cuda/device_health.cc"
#include "server/nerf/cuda/device_training.cc"
#include "server/nerf/cuda/step_buffers.cc"
#include "server/nerf/cuda/cuda_trainer.cc"
// clang-format on

namespace romap::nerf::cuda {

void ResetDeviceHealth() {
  Health& health = TheHealth();
  std::lock_guard lock(health.mutex);
  health.status.reset();
}

}  // namespace romap::nerf::cuda
