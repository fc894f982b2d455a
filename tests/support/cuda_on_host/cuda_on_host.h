#pragma once

// Compiles the same kernels with nvcc and for the host: include this instead of the CUDA headers, and use the two
// macros below for launches and dynamic shared memory. With nvcc they expand to CUDA; otherwise the kernels run on the
// host, one fiber per CUDA thread. This tests their logic, but not speed, memory ordering, tensor core rounding or
// register limits.

#if defined(__CUDACC__)

#include <cuda_fp16.h>
#include <cuda_runtime.h>
#include <mma.h>

// ROMAP_LAUNCH(kernel, grid, block, dynamic_shared_bytes, stream, arguments...)
#define ROMAP_LAUNCH(kernel, grid, block, dynamic_shared_bytes, stream, ...) \
  kernel<<<grid, block, dynamic_shared_bytes, stream>>>(__VA_ARGS__)
// Declares `T* name`, the dynamic shared memory of the block.
#define ROMAP_DYNAMIC_SHARED(T, name)                                 \
  extern __shared__ __align__(128) unsigned char name##_shared_raw[]; \
  T* const name = reinterpret_cast<T*>(name##_shared_raw)

#else

#include "tests/support/cuda_on_host/device_builtins.h"
#include "tests/support/cuda_on_host/runtime_api.h"
#include "tests/support/cuda_on_host/wmma.h"

#define ROMAP_LAUNCH(kernel, grid, block, dynamic_shared_bytes, stream, ...) \
  ::romap::cuda_on_host::Launch(&kernel, grid, block, dynamic_shared_bytes, stream __VA_OPT__(, ) __VA_ARGS__)
#define ROMAP_DYNAMIC_SHARED(T, name) T* const name = static_cast<T*>(::romap::cuda_on_host::DynamicShared())

#endif
