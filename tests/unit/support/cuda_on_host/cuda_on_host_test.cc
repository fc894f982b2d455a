#include "tests/support/cuda_on_host/cuda_on_host.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/unit/support/cuda_on_host/sample_kernels.h"

namespace romap::cuda_on_host_test {

// Device memory that holds a copy of a vector.
template <class T>
class DeviceArray {
 public:
  explicit DeviceArray(const std::vector<T>& values) : size_(values.size()) {
    EXPECT_EQ(cudaMalloc(&data_, size_ * sizeof(T)), cudaSuccess);
    EXPECT_EQ(cudaMemcpy(data_, values.data(), size_ * sizeof(T), cudaMemcpyHostToDevice), cudaSuccess);
  }
  ~DeviceArray() { cudaFree(data_); }
  DeviceArray(const DeviceArray&) = delete;
  DeviceArray& operator=(const DeviceArray&) = delete;

  T* get() { return data_; }
  std::vector<T> Read() const {
    std::vector<T> values(size_);
    EXPECT_EQ(cudaMemcpy(values.data(), data_, size_ * sizeof(T), cudaMemcpyDeviceToHost), cudaSuccess);
    return values;
  }

 private:
  size_t size_;
  T* data_ = nullptr;
};

class CudaOnHost : public testing::TestWithParam<cuda_on_host::RunOptions> {
 protected:
  void SetUp() override {
    cuda_on_host::SetRunOptions(GetParam());
    cuda_on_host::SetDeviceTraits({});
  }
  void TearDown() override { EXPECT_EQ(cudaGetLastError(), cudaSuccess); }
};

INSTANTIATE_TEST_SUITE_P(Orders, CudaOnHost,
                         testing::Values(cuda_on_host::RunOptions{cuda_on_host::ThreadOrder::kForward},
                                         cuda_on_host::RunOptions{cuda_on_host::ThreadOrder::kReverse},
                                         cuda_on_host::RunOptions{cuda_on_host::ThreadOrder::kShuffled, 3},
                                         cuda_on_host::RunOptions{cuda_on_host::ThreadOrder::kShuffled, 4, 2, true}),
                         [](const auto& info) { return "Order" + std::to_string(info.index); });

TEST_P(CudaOnHost, AtomicAddsOfFloatsSumExactly) {
  const int n = 5000;
  const unsigned entries = 1 << 10;
  DeviceArray<float> table(std::vector<float>(entries, 0.0f));
  ROMAP_LAUNCH(ScatterFloat, dim3((n + 255) / 256), dim3(256), 0, nullptr, table.get(), entries - 1, n);
  std::vector<float> expected(entries, 0.0f);
  for (int i = 0; i < n; ++i) {
    for (int c = 0; c < 8; ++c) {
      expected[SampleHash(i % 37 + (c & 1), i % 53 + (c >> 1 & 1), i % 11 + (c >> 2)) & (entries - 1)] +=
          0.0625f * static_cast<float>(i % 5 + c);
    }
  }
  EXPECT_EQ(table.Read(), expected);  // sixteenths: exact in any order
}

TEST_P(CudaOnHost, AtomicAddsOfHalvesSumExactly) {
  const int n = 2000;
  const unsigned entries = 1 << 9;
  DeviceArray<__half2> table(std::vector<__half2>(entries, __half2{0.0f, 0.0f}));
  ROMAP_LAUNCH(ScatterHalf2, dim3((n + 127) / 128), dim3(128), 0, nullptr, table.get(), entries - 1, n);
  std::vector<float> low(entries, 0.0f), high(entries, 0.0f);
  for (int i = 0; i < n; ++i) {
    low[SampleHash(i % 37, i % 53, i % 11) & (entries - 1)] += 0.25f * static_cast<float>(i % 3);
    high[SampleHash(i % 37, i % 53, i % 11) & (entries - 1)] += 0.125f;
  }
  const std::vector<__half2> result = table.Read();
  for (unsigned i = 0; i < entries; ++i) {
    EXPECT_EQ(__low2float(result[i]), low[i]);
    EXPECT_EQ(__high2float(result[i]), high[i]);
  }
}

TEST_P(CudaOnHost, ReductionsSumEachBlock) {
  const int n = 5000, block = 256, blocks = (n + block - 1) / block;
  std::vector<float> values(n), expected(blocks, 0.0f);
  for (int i = 0; i < n; ++i) {
    values[i] = static_cast<float>(i * 7919 % 101) * 0.25f;
    expected[i / block] += values[i];
  }
  DeviceArray<float> in(values), out(std::vector<float>(blocks, 0.0f));
  ROMAP_LAUNCH(ReduceByShuffle<block>, dim3(blocks), dim3(block), 0, nullptr, in.get(), out.get(), n);
  EXPECT_EQ(out.Read(), expected);
  DeviceArray<float> again(std::vector<float>(blocks, 0.0f));
  ROMAP_LAUNCH(ReduceInShared, dim3(blocks), dim3(block), block * sizeof(float), nullptr, in.get(), again.get(), n);
  EXPECT_EQ(again.Read(), expected);
}

TEST_P(CudaOnHost, TensorCoreProductEqualsTheScalarProduct) {
  const int m = 32, n = 32, k = 48;
  std::vector<__half> a(m * k), b(n * k);
  for (int i = 0; i < m * k; ++i) a[i] = static_cast<float>(i * 37 % 17 - 8) * 0.125f;
  for (int i = 0; i < n * k; ++i) b[i] = static_cast<float>(i * 53 % 19 - 9) * 0.0625f;
  DeviceArray<__half> device_a(a), device_b(b);
  DeviceArray<float> c(std::vector<float>(m * n, 0.0f));
  ROMAP_LAUNCH(MultiplyTiles, dim3(n / 16, m / 16), dim3(32), 0, nullptr, device_a.get(), device_b.get(), c.get(), n,
               k);
  const std::vector<float> result = c.Read();
  for (int i = 0; i < m; ++i) {
    for (int j = 0; j < n; ++j) {
      float sum = 0;
      for (int l = 0; l < k; ++l) sum += static_cast<float>(a[i * k + l]) * static_cast<float>(b[j * k + l]);
      EXPECT_NEAR(result[i * n + j], std::max(sum, 0.0f), 1e-5f) << i << "," << j;
    }
  }
}

TEST_P(CudaOnHost, ScanGivesPrefixSums) {
  const int n = 256 * 3 - 40, blocks = 3;
  std::vector<unsigned> values(n), expected(n);
  for (int i = 0; i < n; ++i) {
    values[i] = static_cast<unsigned>(i * 2654435761u) >> 29;
    expected[i] = i % 256 == 0 ? 0 : expected[i - 1] + values[i - 1];
  }
  DeviceArray<unsigned> in(values), out(std::vector<unsigned>(n, 0)), sums(std::vector<unsigned>(blocks, 0));
  ROMAP_LAUNCH(ScanBlocks, dim3(blocks), dim3(256), 0, nullptr, in.get(), out.get(), sums.get(), n);
  EXPECT_EQ(out.Read(), expected);
  EXPECT_EQ(sums.Read()[0], expected[255] + values[255]);
}

TEST_P(CudaOnHost, SpinLockIsExclusive) {
  DeviceArray<int> lock({0}), counter({0});
  ROMAP_LAUNCH(CountUnderLock, dim3(3), dim3(70), 0, nullptr, lock.get(), counter.get());
  EXPECT_EQ(counter.Read()[0], 210);
}

__global__ void Indices(unsigned* out) {
  const unsigned block = (blockIdx.z * gridDim.y + blockIdx.y) * gridDim.x + blockIdx.x;
  const unsigned thread = (threadIdx.z * blockDim.y + threadIdx.y) * blockDim.x + threadIdx.x;
  out[block * blockDim.x * blockDim.y * blockDim.z + thread] = block * 1000 + thread;
}

TEST_P(CudaOnHost, EveryThreadOfEveryBlockRunsOnce) {
  DeviceArray<unsigned> out(std::vector<unsigned>(2 * 3 * 2 * 24, 0));
  ROMAP_LAUNCH(Indices, dim3(2, 3, 2), dim3(4, 3, 2), 0, nullptr, out.get());
  const std::vector<unsigned> result = out.Read();
  for (unsigned i = 0; i < result.size(); ++i) EXPECT_EQ(result[i], i / 24 * 1000 + i % 24);
}

// The two halves of a warp synchronize independently.
__global__ void PartialMasks(int* out) {
  const int lane = static_cast<int>(threadIdx.x % 32);
  const unsigned mask = lane < 16 ? 0x0000ffffu : 0xffff0000u;
  const int rounds = lane < 16 ? 3 : 1;
  int sum = lane;
  for (int round = 0; round < rounds; ++round) {
    for (int flip = 8; flip > 0; flip >>= 1) sum += __shfl_xor_sync(mask, sum, flip, 16);
  }
  out[threadIdx.x] = sum;
}

TEST_P(CudaOnHost, DisjointMasksOfOneWarpAreIndependent) {
  DeviceArray<int> out(std::vector<int>(32, 0));
  ROMAP_LAUNCH(PartialMasks, dim3(1), dim3(32), 0, nullptr, out.get());
  const std::vector<int> result = out.Read();
  for (int lane = 0; lane < 32; ++lane) EXPECT_EQ(result[lane], lane < 16 ? 120 * 16 * 16 : 376) << lane;
}

__global__ void Votes(unsigned* out) {
  const unsigned votes = __ballot_sync(0xffffffffu, threadIdx.x % 3 == 0);
  const int count = __syncthreads_count(threadIdx.x % 3 == 0);
  out[threadIdx.x] = votes * 100 + static_cast<unsigned>(count);
}

TEST_P(CudaOnHost, VotesCountTheThreadsThatExist) {
  DeviceArray<unsigned> out(std::vector<unsigned>(10, 0));
  ROMAP_LAUNCH(Votes, dim3(1), dim3(10), 0, nullptr, out.get());
  for (const unsigned value : out.Read()) EXPECT_EQ(value, 0b1001001001u * 100 + 4);
}

__global__ void ReadUnset(float* out) {
  ROMAP_DYNAMIC_SHARED(float, unset);
  out[0] = unset[threadIdx.x];
}

TEST_P(CudaOnHost, MemoryStartsAsNan) {
  float* out = nullptr;
  ASSERT_EQ(cudaMalloc(&out, 2 * sizeof(float)), cudaSuccess);
  ROMAP_LAUNCH(ReadUnset, dim3(1), dim3(1), 64, nullptr, out);
  float host[2] = {0, 0};
  ASSERT_EQ(cudaMemcpy(host, out, sizeof(host), cudaMemcpyDeviceToHost), cudaSuccess);
  EXPECT_TRUE(std::isnan(host[0]));
  EXPECT_TRUE(std::isnan(host[1]));
  cudaFree(out);
}

}  // namespace romap::cuda_on_host_test
