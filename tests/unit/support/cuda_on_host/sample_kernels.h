#pragma once

// Kernels with the patterns of the CUDA back end: scattered atomics, reductions by shuffles and in shared memory, a
// matrix product on tensor cores, a scan.

#include "tests/support/cuda_on_host/cuda_on_host.h"

namespace romap {

__host__ __device__ inline unsigned SampleHash(unsigned x, unsigned y, unsigned z) {
  return x ^ (y * 2654435761u) ^ (z * 805459861u);
}

// Like the backward pass of a hash grid: each thread adds to eight entries.
__global__ void ScatterFloat(float* table, unsigned mask, int n) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= n) return;
  for (int corner = 0; corner < 8; ++corner) {
    const unsigned entry = SampleHash((i % 37) + (corner & 1), (i % 53) + (corner >> 1 & 1), (i % 11) + (corner >> 2));
    atomicAdd(&table[entry & mask], 0.0625f * static_cast<float>(i % 5 + corner));
  }
}

__global__ void ScatterHalf2(__half2* table, unsigned mask, int n) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= n) return;
  atomicAdd(&table[SampleHash(i % 37, i % 53, i % 11) & mask],
            __floats2half2_rn(0.25f * static_cast<float>(i % 3), 0.125f));
}

template <int kBlock>
__global__ void ReduceByShuffle(const float* in, float* out, int n) {
  __shared__ float warp_sums[kBlock / 32];
  const int i = static_cast<int>(blockIdx.x * kBlock + threadIdx.x);
  float sum = i < n ? in[i] : 0.0f;
  for (unsigned delta = 16; delta > 0; delta >>= 1) sum += __shfl_down_sync(0xffffffffu, sum, delta);
  if (threadIdx.x % 32 == 0) warp_sums[threadIdx.x / 32] = sum;
  __syncthreads();
  if (threadIdx.x < 32) {
    sum = threadIdx.x < kBlock / 32 ? warp_sums[threadIdx.x] : 0.0f;
    for (unsigned delta = kBlock / 64; delta > 0; delta >>= 1) sum += __shfl_down_sync(0xffffffffu, sum, delta);
    if (threadIdx.x == 0) out[blockIdx.x] = sum;
  }
}

__global__ void ReduceInShared(const float* in, float* out, int n) {
  ROMAP_DYNAMIC_SHARED(float, sums);
  const unsigned t = threadIdx.x;
  const int i = static_cast<int>(blockIdx.x * blockDim.x + t);
  sums[t] = i < n ? in[i] : 0.0f;
  __syncthreads();
  for (unsigned stride = blockDim.x / 2; stride > 0; stride >>= 1) {
    if (t < stride) sums[t] += sums[t + stride];
    __syncthreads();
  }
  if (t == 0) out[blockIdx.x] = sums[0];
}

// c (M x N) = relu(a (M x K, row major) * b (K x N, column major)); one warp per 16 x 16 tile.
__global__ void MultiplyTiles(const __half* a, const __half* b, float* c, int n, int k) {
  using namespace nvcuda;
  wmma::fragment<wmma::matrix_a, 16, 16, 16, __half, wmma::row_major> a_tile;
  wmma::fragment<wmma::matrix_b, 16, 16, 16, __half, wmma::col_major> b_tile;
  wmma::fragment<wmma::accumulator, 16, 16, 16, float> sum;
  wmma::fill_fragment(sum, 0.0f);
  const __half* a_rows = a + blockIdx.y * 16 * k;
  const __half* b_cols = b + blockIdx.x * 16 * k;
  for (int step = 0; step < k; step += 16) {
    wmma::load_matrix_sync(a_tile, a_rows + step, k);
    wmma::load_matrix_sync(b_tile, b_cols + step, k);
    wmma::mma_sync(sum, a_tile, b_tile, sum);
  }
  for (int i = 0; i < sum.num_elements; ++i) sum.x[i] = sum.x[i] > 0.0f ? sum.x[i] : 0.0f;
  wmma::store_matrix_sync(c + blockIdx.y * 16 * n + blockIdx.x * 16, sum, n, wmma::mem_row_major);
}

// Exclusive scan within blocks of 256; `sums`: total of each block.
__global__ void ScanBlocks(const unsigned* in, unsigned* out, unsigned* sums, int n) {
  __shared__ unsigned buffer[2][256];
  const int t = static_cast<int>(threadIdx.x);
  const int i = static_cast<int>(blockIdx.x * 256 + threadIdx.x);
  int front = 0;
  const unsigned value = i < n ? in[i] : 0u;
  buffer[0][t] = value;
  __syncthreads();
  for (int reach = 1; reach < 256; reach <<= 1) {
    buffer[front ^ 1][t] = t >= reach ? buffer[front][t] + buffer[front][t - reach] : buffer[front][t];
    front ^= 1;
    __syncthreads();
  }
  if (i < n) out[i] = buffer[front][t] - value;
  if (t == 255) sums[blockIdx.x] = buffer[front][t];
}

// Each thread adds 1 to a counter protected by a spin lock.
__global__ void CountUnderLock(int* lock, int* counter) {
  while (atomicCAS(lock, 0, 1) != 0) {
  }
  *counter += 1;
  __threadfence();
  atomicExch(lock, 0);
}

}  // namespace romap
