#pragma once

// The interface of this folder to CUDA. Kernels are launched by ROMAP_LAUNCH(kernel, grid, block, dynamic_shared_bytes,
// stream, arguments...) and declare dynamic shared memory by ROMAP_DYNAMIC_SHARED(type, name). A program that runs them
// on the host defines both macros and the CUDA functions it needs before it includes the sources of this folder;
// otherwise the real CUDA is used.
#ifndef ROMAP_LAUNCH

#include <cuda_runtime.h>

#define ROMAP_LAUNCH(kernel, grid, block, dynamic_shared_bytes, stream, ...) \
  kernel<<<grid, block, dynamic_shared_bytes, stream>>>(__VA_ARGS__)

#define ROMAP_DYNAMIC_SHARED(T, name)                                 \
  extern __shared__ __align__(128) unsigned char name##_shared_raw[]; \
  T* const name = reinterpret_cast<T*>(name##_shared_raw)

#ifdef __CUDACC__
#include <cuda_fp16.h>
#include <mma.h>
#endif

#endif
