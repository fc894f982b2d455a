// The CUDA back end as host code, in the place of the library's: the first header provides all it needs of CUDA.
// clang-format off
#include "tests/support/cuda_on_host/cuda_on_host.h"

#include "server/nerf/cuda/step_kernel.cu"
#include "server/nerf/cuda/optimise_kernels.cu"
#include "server/nerf/cuda/cuda_field.cc"
#include "server/nerf/cuda/device_health.cc"
#include "server/nerf/cuda/device_training.cc"
#include "server/nerf/cuda/cuda_trainer.cc"
// clang-format on
