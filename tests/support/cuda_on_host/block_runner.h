#pragma once

// Runs the threads of CUDA blocks on the host: one fiber per CUDA thread, one block at a time per OS thread. Kernels do
// not include this file; they see it through device_builtins.h.

#include <cstddef>
#include <cstdint>
#include <functional>

#include "tests/support/cuda_on_host/cuda_types.h"

namespace romap::cuda_on_host {

inline constexpr unsigned kWarpSize = 32;
inline constexpr unsigned kMaxThreadsPerBlock = 1024;

// In which order the runnable threads of a block take their turns. A missing barrier often shows in one order only, so
// tests run kernels in all of them.
enum class ThreadOrder { kForward, kReverse, kShuffled };

struct RunOptions {
  ThreadOrder order = ThreadOrder::kForward;
  uint32_t shuffle_seed = 1;
  int workers = 1;  // OS threads that take blocks
  // A barrier that some threads of the block never reach, because they returned, is an error. Real devices let it pass.
  bool strict_barriers = false;
};

// For all launches from now on; not during a launch.
void SetRunOptions(const RunOptions& options);
const RunOptions& GetRunOptions();

// Runs `kernel` once per thread of the grid and returns when all have. Launch limits are the caller's to check. A
// kernel that breaks the rules (a barrier at two places, a warp collective that a named lane never joins, a deadlock)
// ends the process with a message that begins with "cuda_on_host:".
void RunGrid(dim3 grid, dim3 block, size_t dynamic_shared_bytes, const std::function<void()>& kernel);

[[noreturn]] void Die(const char* what, int line = 0);

// ------------------------------------------------------------------- for the thread that runs now

const uint3& ThreadIndex();
const uint3& BlockIndex();
const dim3& BlockDim();
const dim3& GridDim();
unsigned Lane();
void* DynamicShared();  // 128-byte aligned, all NaN when the block starts

// Waits for all threads of the block; returns for how many of them `predicate` held. `line` tells barriers apart.
unsigned BlockBarrier(int line, bool predicate);

// Waits for all lanes in `mask` (those that exist). A barrier also orders what they do to memory; a meeting, which
// other warp collectives are, does not.
void WarpBarrier(unsigned mask);
void WarpMeeting(unsigned mask);

// Where the lanes of a warp hand values to each other between two WarpMeetings.
struct alignas(16) LaneSlot {
  unsigned char bytes[16];
  const void* pointers[2];
};
LaneSlot& SlotOfLane(unsigned lane);

// Lets the other threads run: for loops that wait for what another thread writes.
void YieldInSpin();

// ------------------------------------------------------------------- for the race checker

// Who runs now and what it has synchronised with. `active` is false outside kernels.
struct ThreadStamp {
  bool active = false;
  uint64_t launch = 0;
  uint64_t block = 0;
  unsigned thread = 0;
  uint64_t block_barriers = 0;  // passed by the block
  uint64_t warp_barriers = 0;   // passed by the warp; meetings do not count
};
ThreadStamp CurrentStamp();
bool InDynamicShared(uintptr_t address);

}  // namespace romap::cuda_on_host
