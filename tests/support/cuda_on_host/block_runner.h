#pragma once

// Runs the threads of CUDA blocks on the host: one fiber per CUDA thread, one block at a time per OS thread. Kernels
// use it through device_builtins.h.

#include <cstddef>
#include <cstdint>
#include <functional>

#include "tests/support/cuda_on_host/cuda_types.h"

namespace romap::cuda_on_host {

inline constexpr unsigned kWarpSize = 32;
inline constexpr unsigned kMaxThreadsPerBlock = 1024;

// Order in which the runnable threads of a block are scheduled. A missing barrier often fails in one order only, so
// tests run kernels in all orders.
enum class ThreadOrder { kForward, kReverse, kShuffled };

struct RunOptions {
  ThreadOrder order = ThreadOrder::kForward;
  uint32_t shuffle_seed = 1;
  int workers = 1;  // OS threads that run blocks
  // Treats a barrier as an error if some threads of the block have returned before it. Real devices allow this.
  bool strict_barriers = false;
};

// Applies to all later launches. Do not call during a launch.
void SetRunOptions(const RunOptions& options);
const RunOptions& GetRunOptions();

// Runs `kernel` once per thread of the grid and returns when all threads have returned. The caller checks the launch
// limits. Invalid kernels (a barrier at two lines, a warp collective that some lane of its mask never calls, a
// deadlock) end the process with a message that starts with "cuda_on_host:".
void RunGrid(dim3 grid, dim3 block, size_t dynamic_shared_bytes, const std::function<void()>& kernel);

[[noreturn]] void Die(const char* what, int line = 0);

// ------------------------------------------------------------------- for the current CUDA thread

const uint3& ThreadIndex();
const uint3& BlockIndex();
const dim3& BlockDim();
const dim3& GridDim();
unsigned Lane();
void* DynamicShared();  // 128-byte aligned, all NaN when the block starts

// Waits for all threads of the block; returns the number of threads whose `predicate` is true. `line` identifies the
// barrier.
unsigned BlockBarrier(int line, bool predicate);

// Waits for all existing lanes in `mask`. WarpBarrier also orders their memory accesses; WarpRendezvous, which is part
// of the other warp collectives, does not.
void WarpBarrier(unsigned mask);
void WarpRendezvous(unsigned mask);

// Lanes of a warp exchange values through these slots, between two WarpRendezvous calls.
struct alignas(16) LaneSlot {
  unsigned char bytes[16];
  const void* pointers[2];
};
LaneSlot& SlotOfLane(unsigned lane);

// Lets other threads run, in loops that wait for a write by another thread.
void YieldInSpin();

// ------------------------------------------------------------------- for the race checker

// The current CUDA thread and its synchronization so far. `active` is false outside kernels.
struct ThreadStamp {
  bool active = false;
  uint64_t launch = 0;
  uint64_t block = 0;
  unsigned thread = 0;
  uint64_t block_barriers = 0;  // passed by the block
  uint64_t warp_barriers = 0;   // passed by the warp; rendezvous do not count
};
ThreadStamp CurrentStamp();
bool InDynamicShared(uintptr_t address);

}  // namespace romap::cuda_on_host
