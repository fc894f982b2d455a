#pragma once

// The part of the CUDA runtime API that we use. Everything is synchronous. Device memory is host memory that starts as
// NaN, and copies are checked against what was allocated.

#include <cstddef>
#include <cstdint>
#include <functional>

#include "tests/support/cuda_on_host/cuda_types.h"

// NOLINTBEGIN: CUDA's names, not ours
enum cudaError_t {
  cudaSuccess = 0,
  cudaErrorInvalidValue = 1,
  cudaErrorMemoryAllocation = 2,
  cudaErrorInvalidConfiguration = 9,
  cudaErrorNoDevice = 100,
  cudaErrorLaunchFailure = 719,
};
enum cudaMemcpyKind {
  cudaMemcpyHostToHost,
  cudaMemcpyHostToDevice,
  cudaMemcpyDeviceToHost,
  cudaMemcpyDeviceToDevice,
};
enum cudaFuncAttribute { cudaFuncAttributeMaxDynamicSharedMemorySize = 8 };
struct CudaStreamOnHost;
using cudaStream_t = CudaStreamOnHost*;
struct CudaEventOnHost;
using cudaEvent_t = CudaEventOnHost*;

const char* cudaGetErrorString(cudaError_t error);
cudaError_t cudaGetLastError();  // and forgets it
cudaError_t cudaPeekAtLastError();
cudaError_t cudaGetDeviceCount(int* count);
cudaError_t cudaSetDevice(int device);
cudaError_t cudaDeviceSynchronize();
cudaError_t cudaMalloc(void** p, size_t bytes);
cudaError_t cudaFree(void* p);
cudaError_t cudaMemset(void* p, int value, size_t bytes);
cudaError_t cudaMemsetAsync(void* p, int value, size_t bytes, cudaStream_t stream);
cudaError_t cudaMemcpy(void* to, const void* from, size_t bytes, cudaMemcpyKind kind);
cudaError_t cudaMemcpyAsync(void* to, const void* from, size_t bytes, cudaMemcpyKind kind, cudaStream_t stream);
cudaError_t cudaStreamCreate(cudaStream_t* stream);
cudaError_t cudaStreamDestroy(cudaStream_t stream);
cudaError_t cudaStreamSynchronize(cudaStream_t stream);
cudaError_t cudaEventCreate(cudaEvent_t* event);
cudaError_t cudaEventDestroy(cudaEvent_t event);
cudaError_t cudaEventRecord(cudaEvent_t event, cudaStream_t stream = nullptr);
cudaError_t cudaEventElapsedTime(float* milliseconds, cudaEvent_t start, cudaEvent_t end);
cudaError_t cudaFuncSetAttribute(const void* kernel, cudaFuncAttribute attribute, int value);
template <class T>
cudaError_t cudaMalloc(T** p, size_t bytes) {
  return cudaMalloc(reinterpret_cast<void**>(p), bytes);
}
template <class... Args>
cudaError_t cudaFuncSetAttribute(void (*kernel)(Args...), cudaFuncAttribute attribute, int value) {
  return cudaFuncSetAttribute(reinterpret_cast<const void*>(kernel), attribute, value);
}
// NOLINTEND

namespace romap::cuda_on_host {

// Checks the launch against the limits of a device (1024 threads, grid sides, dynamic shared memory of 48 KB or what
// cudaFuncSetAttribute allowed for `kernel`) and runs it. A refused launch leaves cudaErrorInvalidConfiguration.
void Launch(const void* kernel, dim3 grid, dim3 block, size_t dynamic_shared_bytes, const std::function<void()>& body);

// What the pretended machine is like; for tests of what happens on others. Also forgets the last error.
struct DeviceTraits {
  int devices = 1;  // 0: every call fails with cudaErrorNoDevice
  size_t memory_bytes = size_t{1} << 32;
};
void SetDeviceTraits(const DeviceTraits& traits);

size_t AllocatedBytes();
bool InDeviceMemory(uintptr_t address);

}  // namespace romap::cuda_on_host
