#include "tests/support/cuda_on_host/block_runner.h"

#include <algorithm>
#include <atomic>
#include <boost/context/fiber.hpp>
#include <boost/context/protected_fixedsize_stack.hpp>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <thread>
#include <utility>
#include <vector>

namespace romap::cuda_on_host {
namespace {

namespace context = boost::context;

constexpr size_t kStackBytes = 256 * 1024;
constexpr size_t kSharedAlignment = 128;  // alignment promised by ROMAP_DYNAMIC_SHARED
// Limit of consecutive passes over a block in which threads only spin; a spin lock that is released needs only a few.
constexpr int kMaxSpinPasses = 100'000;

RunOptions g_options;
std::atomic<uint64_t> g_launches{0};

struct Warp {
  uint64_t barriers = 0;
  uint32_t arrived = 0;   // waiting lanes
  uint32_t released = 0;  // lanes whose collective is complete but that have not resumed yet
  uint32_t exited = 0;
  LaneSlot slots[kWarpSize];
};

struct Thread {
  context::fiber fiber;
  uint3 index{};
  unsigned linear = 0;
  bool done = true;
};

// Runs the threads of one block after another; the fibers are reused for every block.
class BlockRunner {
 public:
  BlockRunner(dim3 grid, dim3 block, size_t dynamic_shared_bytes, const std::function<void()>& kernel)
      : grid_dim(grid),
        block_dim(block),
        thread_count(block.x * block.y * block.z),
        dynamic_shared(dynamic_shared_bytes + kSharedAlignment),
        kernel_(kernel),
        threads_(thread_count),
        order_(thread_count) {}

  ~BlockRunner() {
    stopping_ = true;
    for (Thread& thread : threads_) {
      if (thread.fiber) thread.fiber = std::move(thread.fiber).resume();
    }
  }

  void Run(uint64_t block_number);
  void Yield() { scheduler_ = std::move(scheduler_).resume(); }
  unsigned Barrier(int line, bool predicate);
  void WarpArrive(uint32_t mask, bool orders_memory);
  void NoteSpin() { spun_ = true; }
  Warp& CurrentWarp() { return warps[current->linear / kWarpSize]; }

  const dim3 grid_dim;
  const dim3 block_dim;
  const unsigned thread_count;
  uint3 block_index{};
  uint64_t block_linear = 0;
  uint64_t barriers = 0;
  std::vector<unsigned char> dynamic_shared;
  std::vector<Warp> warps;
  Thread* current = nullptr;

 private:
  void Reset(uint64_t block_number);
  void ArrangeOrder();
  void Resume(Thread& thread);
  void OnExit(const Thread& thread);
  void ReleaseBarrier();

  const std::function<void()>& kernel_;
  std::vector<Thread> threads_;
  std::vector<unsigned> order_;
  std::minstd_rand random_;
  context::fiber scheduler_;
  bool stopping_ = false;
  bool progress_ = false;  // in this pass over the threads
  bool spun_ = false;
  unsigned live_ = 0;
  unsigned waiting_ = 0;  // at the barrier
  unsigned votes_ = 0;
  unsigned last_votes_ = 0;
  int barrier_line_ = 0;
};

thread_local BlockRunner* t_runner = nullptr;

BlockRunner& Runner() {
  if (t_runner == nullptr) Die("device code called outside a kernel");
  return *t_runner;
}

void BlockRunner::Reset(uint64_t block_number) {
  block_linear = block_number;
  block_index = {static_cast<unsigned>(block_number % grid_dim.x),
                 static_cast<unsigned>(block_number / grid_dim.x % grid_dim.y),
                 static_cast<unsigned>(block_number / grid_dim.x / grid_dim.y)};
  live_ = thread_count;
  waiting_ = votes_ = 0;
  warps.assign((thread_count + kWarpSize - 1) / kWarpSize, Warp{});
  std::fill(dynamic_shared.begin(), dynamic_shared.end(), 0xff);  // NaN: kernels must not rely on zeros
  for (unsigned i = 0; i < thread_count; ++i) {
    threads_[i].index = {i % block_dim.x, i / block_dim.x % block_dim.y, i / block_dim.x / block_dim.y};
    threads_[i].linear = i;
    threads_[i].done = false;
    order_[i] = g_options.order == ThreadOrder::kReverse ? thread_count - 1 - i : i;
  }
  random_.seed(g_options.shuffle_seed + static_cast<uint32_t>(block_number));
}

void BlockRunner::Run(uint64_t block_number) {
  Reset(block_number);
  int spin_passes = 0;
  while (live_ > 0) {
    progress_ = spun_ = false;
    if (g_options.order == ThreadOrder::kShuffled) std::shuffle(order_.begin(), order_.end(), random_);
    for (const unsigned i : order_) {
      if (!threads_[i].done) Resume(threads_[i]);
    }
    if (progress_) {
      spin_passes = 0;
    } else if (!spun_ || ++spin_passes > kMaxSpinPasses) {
      Die("deadlock: threads wait for threads that never arrive");
    }
  }
}

void BlockRunner::Resume(Thread& thread) {
  current = &thread;
  if (!thread.fiber) {
    thread.fiber = context::fiber(std::allocator_arg, context::protected_fixedsize_stack(kStackBytes),
                                  [this, &thread](context::fiber&& scheduler) {
                                    scheduler_ = std::move(scheduler);
                                    while (!stopping_) {
                                      kernel_();
                                      thread.done = true;
                                      Yield();
                                    }
                                    return std::move(scheduler_);
                                  });
  }
  // While a fiber runs, `scheduler_` returns to this function; Yield() updates it each time.
  thread.fiber = std::move(thread.fiber).resume();
  current = nullptr;
  if (thread.done) OnExit(thread);
}

void BlockRunner::OnExit(const Thread& thread) {
  --live_;
  progress_ = true;
  warps[thread.linear / kWarpSize].exited |= 1u << thread.linear % kWarpSize;
  if (waiting_ > 0 && g_options.strict_barriers)
    Die("a thread returned while others wait at __syncthreads", barrier_line_);
  if (live_ > 0 && waiting_ == live_) ReleaseBarrier();
}

void BlockRunner::ReleaseBarrier() {
  waiting_ = 0;
  last_votes_ = votes_;
  votes_ = 0;
  ++barriers;
  progress_ = true;
}

unsigned BlockRunner::Barrier(int line, bool predicate) {
  if (waiting_ > 0 && line != barrier_line_) Die("threads wait at two different __syncthreads", line);
  if (live_ != thread_count && g_options.strict_barriers) Die("__syncthreads after a thread returned", line);
  barrier_line_ = line;
  ++waiting_;
  votes_ += predicate;
  progress_ = true;
  const uint64_t before = barriers;
  if (waiting_ == live_) ReleaseBarrier();
  while (barriers == before) Yield();
  return last_votes_;
}

void BlockRunner::WarpArrive(uint32_t mask, bool orders_memory) {
  Warp& warp = CurrentWarp();
  const unsigned lane = current->linear % kWarpSize;
  const uint32_t self = 1u << lane;
  const unsigned lanes = std::min(kWarpSize, thread_count - current->linear / kWarpSize * kWarpSize);
  if (lanes < kWarpSize) mask &= (1u << lanes) - 1;
  if ((mask & self) == 0) Die("a lane calls a warp collective whose mask does not contain it");
  if ((warp.exited & mask) != 0) Die("the mask of a warp collective contains a lane that has returned");
  warp.arrived |= self;
  progress_ = true;
  if ((warp.arrived & mask) == mask) {
    warp.arrived &= ~mask;
    warp.released |= mask;
    if (orders_memory) ++warp.barriers;
  }
  while ((warp.released & self) == 0) Yield();
  warp.released &= ~self;
}

}  // namespace

void SetRunOptions(const RunOptions& options) { g_options = options; }
const RunOptions& GetRunOptions() { return g_options; }

void RunGrid(dim3 grid, dim3 block, size_t dynamic_shared_bytes, const std::function<void()>& kernel) {
  ++g_launches;
  const uint64_t blocks = uint64_t{grid.x} * grid.y * grid.z;
  std::atomic<uint64_t> next{0};
  const auto work = [&] {
    BlockRunner runner(grid, block, dynamic_shared_bytes, kernel);
    t_runner = &runner;
    for (uint64_t i = next++; i < blocks; i = next++) runner.Run(i);
    t_runner = nullptr;
  };
  const uint64_t workers = std::min<uint64_t>(static_cast<uint64_t>(std::max(1, g_options.workers)), blocks);
  if (workers == 1) return work();
  std::vector<std::thread> threads;
  for (uint64_t i = 0; i < workers; ++i) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();
}

void Die(const char* what, int line) {
  if (line > 0) {
    std::fprintf(stderr, "cuda_on_host: %s (line %d)\n", what, line);
  } else {
    std::fprintf(stderr, "cuda_on_host: %s\n", what);
  }
  std::abort();
}

const uint3& ThreadIndex() { return Runner().current->index; }
const uint3& BlockIndex() { return Runner().block_index; }
const dim3& BlockDim() { return Runner().block_dim; }
const dim3& GridDim() { return Runner().grid_dim; }
unsigned Lane() { return Runner().current->linear % kWarpSize; }
unsigned BlockBarrier(int line, bool predicate) { return Runner().Barrier(line, predicate); }
void WarpBarrier(unsigned mask) { Runner().WarpArrive(mask, true); }
void WarpRendezvous(unsigned mask) { Runner().WarpArrive(mask, false); }
LaneSlot& SlotOfLane(unsigned lane) { return Runner().CurrentWarp().slots[lane]; }

void* DynamicShared() {
  const auto address = reinterpret_cast<uintptr_t>(Runner().dynamic_shared.data());
  return reinterpret_cast<void*>((address + kSharedAlignment - 1) / kSharedAlignment * kSharedAlignment);
}

void YieldInSpin() {
  Runner().NoteSpin();
  Runner().Yield();
}

ThreadStamp CurrentStamp() {
  if (t_runner == nullptr || t_runner->current == nullptr) return {};
  return {true,
          g_launches,
          t_runner->block_linear,
          t_runner->current->linear,
          t_runner->barriers,
          t_runner->CurrentWarp().barriers};
}

bool InDynamicShared(uintptr_t address) {
  if (t_runner == nullptr) return false;
  const auto begin = reinterpret_cast<uintptr_t>(t_runner->dynamic_shared.data());
  return address >= begin && address < begin + t_runner->dynamic_shared.size();
}

}  // namespace romap::cuda_on_host
