#pragma once

// The features of CUDA device code that the kernels use: qualifiers, built-in variables, barriers, warp collectives and
// atomics. Names are those of CUDA.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "tests/support/cuda_on_host/block_runner.h"
#include "tests/support/cuda_on_host/cuda_types.h"

// NOLINTBEGIN: CUDA's names, not ours
#define __global__
#define __device__
#define __host__
#define __forceinline__ inline
#define __noinline__
#define __constant__ static
#define __launch_bounds__(...)
#define __align__(n) alignas(n)
#define __shared__ static thread_local  // a block runs on one OS thread

#define threadIdx (::romap::cuda_on_host::ThreadIndex())
#define blockIdx (::romap::cuda_on_host::BlockIndex())
#define blockDim (::romap::cuda_on_host::BlockDim())
#define gridDim (::romap::cuda_on_host::GridDim())
static constexpr int warpSize = 32;

#define __syncthreads() ((void)::romap::cuda_on_host::BlockBarrier(__LINE__, false))
#define __syncthreads_count(predicate) \
  (static_cast<int>(::romap::cuda_on_host::BlockBarrier(__LINE__, (predicate) != 0)))
#define __syncthreads_or(predicate) (__syncthreads_count(predicate) > 0)

inline void __syncwarp(unsigned mask = 0xffffffffu) { romap::cuda_on_host::WarpBarrier(mask); }
inline void __threadfence() { std::atomic_thread_fence(std::memory_order_seq_cst); }
inline void __threadfence_block() { __threadfence(); }
// Spin loops must call this: a fiber runs until it yields.
inline void __nanosleep(unsigned) { romap::cuda_on_host::YieldInSpin(); }
inline int __popc(unsigned x) { return __builtin_popcount(x); }
inline int __popcll(unsigned long long x) { return __builtin_popcountll(x); }
inline int __ffs(int x) { return __builtin_ffs(x); }
inline unsigned __float_as_uint(float x) { return __builtin_bit_cast(unsigned, x); }
inline float __uint_as_float(unsigned x) { return __builtin_bit_cast(float, x); }
inline float __fmaf_rn(float a, float b, float c) { return std::fma(a, b, c); }
template <class T>
T __ldg(const T* p) {
  return *p;
}

namespace romap::cuda_on_host {

// The value of lane `source`; NaN when that lane is not in the mask, where CUDA leaves it undefined.
template <class T>
T Exchange(unsigned mask, const T& value, int source) {
  static_assert(sizeof(T) <= sizeof(LaneSlot::bytes) && std::is_trivially_copyable_v<T>);
  std::memcpy(SlotOfLane(Lane()).bytes, &value, sizeof(T));
  WarpRendezvous(mask);
  T result;
  if ((mask >> source & 1) != 0) {
    std::memcpy(static_cast<void*>(&result), SlotOfLane(static_cast<unsigned>(source)).bytes, sizeof(T));
  } else {
    std::memset(static_cast<void*>(&result), 0xff, sizeof(T));
  }
  WarpRendezvous(mask);
  return result;
}

// Replaces *target by update(*target) atomically; returns the old value.
template <class Bits, class T, class Update>
T AtomicUpdate(T* target, Update update) {
  static_assert(sizeof(Bits) == sizeof(T));
  Bits* const bits = reinterpret_cast<Bits*>(target);
  Bits before = __atomic_load_n(bits, __ATOMIC_RELAXED);
  for (;;) {
    T old;
    std::memcpy(static_cast<void*>(&old), &before, sizeof(T));
    const T updated = update(old);
    Bits after;
    std::memcpy(&after, static_cast<const void*>(&updated), sizeof(T));
    if (__atomic_compare_exchange_n(bits, &before, after, false, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) return old;
  }
}

template <class T>
using BitsOf = std::conditional_t<sizeof(T) == 2, uint16_t, std::conditional_t<sizeof(T) == 4, uint32_t, uint64_t>>;

}  // namespace romap::cuda_on_host

template <class T>
T __shfl_sync(unsigned mask, T value, int source, int width = 32) {
  const int lane = static_cast<int>(romap::cuda_on_host::Lane());
  return romap::cuda_on_host::Exchange(mask, value, lane / width * width + (source & (width - 1)));
}
template <class T>
T __shfl_down_sync(unsigned mask, T value, unsigned delta, int width = 32) {
  const int lane = static_cast<int>(romap::cuda_on_host::Lane());
  const bool in_group = lane % width + static_cast<int>(delta) < width;
  return romap::cuda_on_host::Exchange(mask, value, in_group ? lane + static_cast<int>(delta) : lane);
}
template <class T>
T __shfl_up_sync(unsigned mask, T value, unsigned delta, int width = 32) {
  const int lane = static_cast<int>(romap::cuda_on_host::Lane());
  const bool in_group = lane % width >= static_cast<int>(delta);
  return romap::cuda_on_host::Exchange(mask, value, in_group ? lane - static_cast<int>(delta) : lane);
}
template <class T>
T __shfl_xor_sync(unsigned mask, T value, int lane_mask, int width = 32) {
  const int lane = static_cast<int>(romap::cuda_on_host::Lane());
  const int source = lane ^ lane_mask;
  return romap::cuda_on_host::Exchange(mask, value, source < (lane / width + 1) * width ? source : lane);
}
inline unsigned __ballot_sync(unsigned mask, int predicate) {
  using namespace romap::cuda_on_host;
  SlotOfLane(Lane()).bytes[0] = predicate != 0;
  WarpRendezvous(mask);
  unsigned votes = 0;
  for (unsigned lane = 0; lane < kWarpSize; ++lane) {
    if ((mask >> lane & 1) != 0 && SlotOfLane(lane).bytes[0] == 1) votes |= 1u << lane;
  }
  WarpRendezvous(mask);
  return votes;
}
inline int __any_sync(unsigned mask, int predicate) { return __ballot_sync(mask, predicate) != 0; }
inline int __all_sync(unsigned mask, int predicate) { return __ballot_sync(mask, !predicate) == 0; }

template <class T>
T atomicAdd(T* target, T value) {
  static_assert(std::is_arithmetic_v<T>, "atomicAdd of this type is not emulated");
  return romap::cuda_on_host::AtomicUpdate<romap::cuda_on_host::BitsOf<T>>(
      target, [=](T old) { return static_cast<T>(old + value); });
}
inline __half atomicAdd(__half* target, __half value) {
  return romap::cuda_on_host::AtomicUpdate<uint16_t>(target, [=](__half old) { return __hadd(old, value); });
}
inline __half2 atomicAdd(__half2* target, __half2 value) {
  return romap::cuda_on_host::AtomicUpdate<uint32_t>(target, [=](__half2 old) { return __hadd2(old, value); });
}
template <class T>
T atomicMax(T* target, T value) {
  return romap::cuda_on_host::AtomicUpdate<romap::cuda_on_host::BitsOf<T>>(target,
                                                                           [=](T old) { return std::max(old, value); });
}
template <class T>
T atomicMin(T* target, T value) {
  return romap::cuda_on_host::AtomicUpdate<romap::cuda_on_host::BitsOf<T>>(target,
                                                                           [=](T old) { return std::min(old, value); });
}
template <class T>
T atomicExch(T* target, T value) {
  return romap::cuda_on_host::AtomicUpdate<romap::cuda_on_host::BitsOf<T>>(target, [=](T) { return value; });
}
template <class T>
T atomicCAS(T* target, T expected, T desired) {
  const T old = romap::cuda_on_host::AtomicUpdate<romap::cuda_on_host::BitsOf<T>>(
      target, [=](T now) { return now == expected ? desired : now; });
  // The caller will probably retry, so let the thread that holds the lock run.
  if (old != expected) romap::cuda_on_host::YieldInSpin();
  return old;
}
// NOLINTEND
