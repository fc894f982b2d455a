#include "tests/unit/support/cuda_on_host/race/race_kernels.h"

#include "tests/support/cuda_on_host/cuda_on_host.h"

namespace romap {
namespace {

constexpr int kBlock = 64;
constexpr int kBlocks = 3;

// Zeroed device memory with one word per thread.
class Words {
 public:
  Words() {
    cudaMalloc(&data_, kBlock * kBlocks * sizeof(int));
    cudaMemset(data_, 0, kBlock * kBlocks * sizeof(int));
  }
  ~Words() { cudaFree(data_); }
  Words(const Words&) = delete;
  Words& operator=(const Words&) = delete;
  int* get() { return data_; }

 private:
  int* data_ = nullptr;
};

__global__ void TreeSum(int* out, bool with_barriers) {
  ROMAP_DYNAMIC_SHARED(int, sums);
  const unsigned t = threadIdx.x;
  sums[t] = static_cast<int>(t);
  __syncthreads();
  for (unsigned stride = kBlock / 2; stride > 0; stride >>= 1) {
    if (t < stride) sums[t] += sums[t + stride];
    if (with_barriers) __syncthreads();
  }
  if (t == 0) out[blockIdx.x] = sums[0];
}

__global__ void LaneExchange(int* out, bool with_warp_barrier) {
  __shared__ int values[kBlock];
  const unsigned t = threadIdx.x;
  values[t] = static_cast<int>(t);
  if (with_warp_barrier) {
    __syncwarp();
  } else {
    __any_sync(0xffffffffu, 1);  // synchronizes the lanes, but does not order their memory accesses
  }
  out[blockIdx.x * kBlock + t] = values[t ^ 1];
}

__global__ void Count(int* counter, bool atomically) {
  if (atomically) {
    atomicAdd(counter, 1);
  } else {
    *counter += 1;
  }
}

__global__ void NeighborRead(int* words, bool own_word) {
  const unsigned i = blockIdx.x * kBlock + threadIdx.x;
  words[i] = 1;
  __syncthreads();
  const unsigned other = own_word ? i : (i + kBlock) % (kBlock * kBlocks);
  if (words[other] > 5) words[i] = 2;
}

__global__ void BufferReuse(int* out, bool with_barrier_before_refill) {
  __shared__ int buffer[kBlock];
  const unsigned t = threadIdx.x;
  int sum = 0;
  for (int round = 0; round < 2; ++round) {
    buffer[t] = round;
    __syncthreads();
    sum += buffer[kBlock - 1 - t];
    if (with_barrier_before_refill) __syncthreads();
  }
  out[blockIdx.x * kBlock + t] = sum;
}

}  // namespace

void RunTreeSum(bool with_barriers) {
  Words words;
  ROMAP_LAUNCH(TreeSum, dim3(kBlocks), dim3(kBlock), kBlock * sizeof(int), nullptr, words.get(), with_barriers);
}
void RunLaneExchange(bool with_warp_barrier) {
  Words words;
  ROMAP_LAUNCH(LaneExchange, dim3(kBlocks), dim3(kBlock), 0, nullptr, words.get(), with_warp_barrier);
}
void RunCount(bool atomically) {
  Words words;
  ROMAP_LAUNCH(Count, dim3(kBlocks), dim3(kBlock), 0, nullptr, words.get(), atomically);
}
void RunNeighborRead(bool own_word) {
  Words words;
  ROMAP_LAUNCH(NeighborRead, dim3(kBlocks), dim3(kBlock), 0, nullptr, words.get(), own_word);
}
void RunBufferReuse(bool with_barrier_before_refill) {
  Words words;
  ROMAP_LAUNCH(BufferReuse, dim3(kBlocks), dim3(kBlock), 0, nullptr, words.get(), with_barrier_before_refill);
}

}  // namespace romap
