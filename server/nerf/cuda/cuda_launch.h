#pragma once

// How this folder meets CUDA. Kernels are launched by ROMAP_LAUNCH(kernel, grid, block, dynamic_shared_bytes, stream,
// arguments...). A program that runs them on the host defines it, and what it needs of CUDA, before it includes the
// sources of this folder; everywhere else the real CUDA is used.
#ifndef ROMAP_LAUNCH

#include <cuda_runtime.h>

#define ROMAP_LAUNCH(kernel, grid, block, dynamic_shared_bytes, stream, ...) \
  kernel<<<grid, block, dynamic_shared_bytes, stream>>>(__VA_ARGS__)

#endif
