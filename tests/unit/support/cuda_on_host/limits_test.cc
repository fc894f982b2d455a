#include <gtest/gtest.h>

#include <vector>

#include "tests/support/cuda_on_host/cuda_on_host.h"

namespace romap::limits_test {

class CudaLimits : public testing::Test {
 protected:
  void SetUp() override {
    cuda_on_host::SetRunOptions({});
    cuda_on_host::SetDeviceTraits({});
  }
  void TearDown() override { cuda_on_host::SetDeviceTraits({}); }
};
using CudaLimitsDeathTest = CudaLimits;

__global__ void EmptyKernel() {}

cudaError_t LaunchEmptyKernel(dim3 grid, dim3 block, size_t shared_bytes) {
  ROMAP_LAUNCH(EmptyKernel, grid, block, shared_bytes, nullptr);
  return cudaGetLastError();
}

TEST_F(CudaLimits, LaunchesBeyondTheLimitsAreRejected) {
  EXPECT_EQ(LaunchEmptyKernel(dim3(1), dim3(1024), 48 * 1024), cudaSuccess);
  EXPECT_EQ(LaunchEmptyKernel(dim3(1), dim3(1025), 0), cudaErrorInvalidConfiguration);
  EXPECT_EQ(LaunchEmptyKernel(dim3(1), dim3(32, 33), 0), cudaErrorInvalidConfiguration);
  EXPECT_EQ(LaunchEmptyKernel(dim3(1), dim3(1, 1, 65), 0), cudaErrorInvalidConfiguration);
  EXPECT_EQ(LaunchEmptyKernel(dim3(0), dim3(32), 0), cudaErrorInvalidConfiguration);
  EXPECT_EQ(LaunchEmptyKernel(dim3(1, 65536), dim3(32), 0), cudaErrorInvalidConfiguration);
}

__global__ void EmptyKernelWithSharedMemory() {}

TEST_F(CudaLimits, MoreSharedMemoryMustBeRequested) {
  const auto launch = [] {
    ROMAP_LAUNCH(EmptyKernelWithSharedMemory, dim3(1), dim3(1), 60 * 1024, nullptr);
    return cudaGetLastError();
  };
  EXPECT_EQ(launch(), cudaErrorInvalidConfiguration);
  EXPECT_EQ(cudaFuncSetAttribute(EmptyKernelWithSharedMemory, cudaFuncAttributeMaxDynamicSharedMemorySize, 60 * 1024),
            cudaSuccess);
  EXPECT_EQ(launch(), cudaSuccess);
  EXPECT_EQ(cudaFuncSetAttribute(EmptyKernelWithSharedMemory, cudaFuncAttributeMaxDynamicSharedMemorySize, 1 << 20),
            cudaErrorInvalidValue);
}

TEST_F(CudaLimits, MemoryIsLimitedAndCounted) {
  cuda_on_host::SetDeviceTraits({.memory_bytes = 1000});
  const size_t before = cuda_on_host::AllocatedBytes();
  char* first = nullptr;
  char* second = nullptr;
  EXPECT_EQ(cudaMalloc(&first, 600), cudaSuccess);
  EXPECT_EQ(cudaMalloc(&second, 600), cudaErrorMemoryAllocation);
  EXPECT_EQ(second, nullptr);
  EXPECT_EQ(cuda_on_host::AllocatedBytes(), before + 600);
  EXPECT_EQ(cudaFree(first), cudaSuccess);
  EXPECT_EQ(cuda_on_host::AllocatedBytes(), before);
  EXPECT_EQ(cudaFree(&second), cudaErrorInvalidValue);
}

TEST_F(CudaLimits, CopiesBeyondAnAllocationAreRejected) {
  char* device = nullptr;
  ASSERT_EQ(cudaMalloc(&device, 100), cudaSuccess);
  std::vector<char> host(200);
  EXPECT_EQ(cudaMemcpy(device + 50, host.data(), 50, cudaMemcpyHostToDevice), cudaSuccess);
  EXPECT_EQ(cudaMemcpy(device + 50, host.data(), 51, cudaMemcpyHostToDevice), cudaErrorInvalidValue);
  EXPECT_EQ(cudaMemcpy(host.data(), host.data() + 100, 10, cudaMemcpyDeviceToHost), cudaErrorInvalidValue);
  EXPECT_EQ(cudaMemset(device, 0, 101), cudaErrorInvalidValue);
  EXPECT_EQ(cudaFree(device), cudaSuccess);
}

TEST_F(CudaLimits, WithoutADeviceEveryCallFails) {
  cuda_on_host::SetDeviceTraits({.devices = 0});
  int count = -1;
  EXPECT_EQ(cudaGetDeviceCount(&count), cudaErrorNoDevice);
  EXPECT_EQ(count, 0);
  void* p = nullptr;
  EXPECT_EQ(cudaMalloc(&p, 10), cudaErrorNoDevice);
  EXPECT_EQ(LaunchEmptyKernel(dim3(1), dim3(1), 0), cudaErrorNoDevice);
  EXPECT_STREQ(cudaGetErrorString(cudaErrorNoDevice), "no CUDA-capable device is detected");
}

__global__ void BarrierInBothBranches() {
  if (threadIdx.x < 16) {
    __syncthreads();
  } else {
    __syncthreads();
  }
}
__global__ void BarrierThatSomeSkip() {
  if (threadIdx.x == 5) return;
  __syncthreads();
}
__global__ void ShuffleThatSomeSkip(int* out) {
  if (threadIdx.x == 5) return;
  *out = __shfl_sync(0xffffffffu, 1, 0);
}
__global__ void WaitForever(int* flag) {
  while (atomicAdd(flag, 0) == 0) __nanosleep(100);
}
__global__ void WarpWaitsForBarrier(int* out) {
  if (threadIdx.x == 0) {
    __syncthreads();
  } else {
    *out = __shfl_sync(0xffffffffu, 1, 0);
  }
}
__global__ void MisalignedTile(float* p) {
  nvcuda::wmma::fragment<nvcuda::wmma::accumulator, 16, 16, 16, float> tile;
  nvcuda::wmma::fill_fragment(tile, 0.0f);
  nvcuda::wmma::store_matrix_sync(p + 1, tile, 16, nvcuda::wmma::mem_row_major);
}

TEST_F(CudaLimitsDeathTest, InvalidKernelsEndTheProcess) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  int* out = nullptr;
  ASSERT_EQ(cudaMalloc(&out, 2048), cudaSuccess);
  ASSERT_EQ(cudaMemset(out, 0, 2048), cudaSuccess);
  EXPECT_DEATH(ROMAP_LAUNCH(BarrierInBothBranches, dim3(1), dim3(32), 0, nullptr),
               "threads wait at two different __syncthreads");
  EXPECT_DEATH(ROMAP_LAUNCH(ShuffleThatSomeSkip, dim3(1), dim3(32), 0, nullptr, out),
               "contains a lane that has returned");
  EXPECT_DEATH(ROMAP_LAUNCH(WaitForever, dim3(1), dim3(2), 0, nullptr, out), "deadlock");
  EXPECT_DEATH(ROMAP_LAUNCH(WarpWaitsForBarrier, dim3(1), dim3(32), 0, nullptr, out), "deadlock");
  EXPECT_DEATH(ROMAP_LAUNCH(MisalignedTile, dim3(1), dim3(32), 0, nullptr, reinterpret_cast<float*>(out)),
               "not aligned to 32 bytes");
  cudaFree(out);
}

TEST_F(CudaLimitsDeathTest, StrictBarriersMustBeReachedByAll) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  ROMAP_LAUNCH(BarrierThatSomeSkip, dim3(1), dim3(32), 0, nullptr);  // real devices allow it
  cuda_on_host::SetRunOptions({.strict_barriers = true});
  EXPECT_DEATH(ROMAP_LAUNCH(BarrierThatSomeSkip, dim3(1), dim3(32), 0, nullptr), "__syncthreads");
}

}  // namespace romap::limits_test
