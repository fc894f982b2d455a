#pragma once

// Limits of the resources of each kernel, enforced by a test that compiles the PTX of this folder for every
// architecture below. With more registers or shared memory fewer blocks run on a multiprocessor at a time and the
// latency of memory is no longer hidden; spilled registers add memory accesses.

#include <cstddef>

namespace romap::nerf::cuda {

struct ResourceLimit {
  const char* kernel;  // prefix of its name
  int registers;       // per thread
  int spill_bytes;     // per thread, stores and loads
  int stack_bytes;     // per thread
};

inline constexpr ResourceLimit kResourceLimits[] = {
    {"StepKernel", 128, 0, 0},  // four blocks of 128 threads in the 65536 registers of a multiprocessor
    {"EvaluateKernel", 64, 0, 0},
    {"OptimizeKernel", 48, 0, 0},
    {"OccupancyKernel", 48, 0, 0},
};

// Dynamic shared memory of a block of StepKernel on tensor cores.
inline constexpr size_t kFastStepSharedBytes = 40 * 1024;   // fast preset: four blocks on 164 KB, two on 100 KB
inline constexpr size_t kPaperStepSharedBytes = 64 * 1024;  // the paper's field: two blocks on 164 KB, one on 100 KB
inline constexpr size_t kMaxStepSharedBytes = 99 * 1024;    // any field: the limit of a block on all devices since 8.0

inline constexpr int kArchitectures[] = {80, 86, 89, 90, 100, 120};

}  // namespace romap::nerf::cuda
