// The CUDA sources as host code: the first header provides all they need of CUDA.
// clang-format off
#include "tests/support/cuda_on_host/cuda_on_host.h"

#include "server/nerf/cuda/field_kernels.cu"
#include "server/nerf/cuda/cuda_field.cc"
// clang-format on
