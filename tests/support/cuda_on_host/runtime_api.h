#pragma once

// The part of the CUDA runtime API that the back end uses. Device memory is host memory initialized to NaN, and copies
// are checked against the allocations. Work of a stream is executed as late as CUDA allows, at the next
// synchronization, so that code without the necessary synchronization reads NaN or old values; the default stream
// executes immediately.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <tuple>
#include <type_traits>

#include "tests/support/cuda_on_host/cuda_types.h"

// NOLINTBEGIN: CUDA's names, not ours
enum cudaError_t {
  cudaSuccess = 0,
  cudaErrorInvalidValue = 1,
  cudaErrorMemoryAllocation = 2,
  cudaErrorInvalidConfiguration = 9,
  cudaErrorNoDevice = 100,
  cudaErrorLaunchFailure = 719,
  cudaErrorStreamCaptureUnsupported = 900,
};
enum cudaMemcpyKind {
  cudaMemcpyHostToHost,
  cudaMemcpyHostToDevice,
  cudaMemcpyDeviceToHost,
  cudaMemcpyDeviceToDevice,
};
enum cudaStreamCaptureMode { cudaStreamCaptureModeGlobal, cudaStreamCaptureModeThreadLocal };
inline constexpr unsigned cudaStreamNonBlocking = 1;
enum cudaFuncAttribute { cudaFuncAttributeMaxDynamicSharedMemorySize = 8 };
struct CudaStreamOnHost;
using cudaStream_t = CudaStreamOnHost*;
struct CudaEventOnHost;
using cudaEvent_t = CudaEventOnHost*;
struct CudaGraphOnHost;
using cudaGraph_t = CudaGraphOnHost*;
using cudaGraphExec_t = CudaGraphOnHost*;
struct cudaDeviceProp {
  char name[256];
  int major, minor, multiProcessorCount;
};

const char* cudaGetErrorString(cudaError_t error);
cudaError_t cudaGetLastError();  // also clears it
cudaError_t cudaPeekAtLastError();
cudaError_t cudaGetDeviceCount(int* count);
cudaError_t cudaSetDevice(int device);
cudaError_t cudaGetDeviceProperties(cudaDeviceProp* properties, int device);
cudaError_t cudaDeviceSynchronize();
cudaError_t cudaMalloc(void** p, size_t bytes);
cudaError_t cudaFree(void* p);
cudaError_t cudaMallocHost(void** p, size_t bytes);
cudaError_t cudaFreeHost(void* p);
cudaError_t cudaMemset(void* p, int value, size_t bytes);
cudaError_t cudaMemsetAsync(void* p, int value, size_t bytes, cudaStream_t stream);
cudaError_t cudaMemcpy(void* to, const void* from, size_t bytes, cudaMemcpyKind kind);
cudaError_t cudaMemcpyAsync(void* to, const void* from, size_t bytes, cudaMemcpyKind kind, cudaStream_t stream);
cudaError_t cudaStreamCreateWithFlags(cudaStream_t* stream, unsigned flags);
cudaError_t cudaStreamDestroy(cudaStream_t stream);
cudaError_t cudaStreamSynchronize(cudaStream_t stream);
cudaError_t cudaStreamBeginCapture(cudaStream_t stream, cudaStreamCaptureMode mode);
cudaError_t cudaStreamEndCapture(cudaStream_t stream, cudaGraph_t* graph);
cudaError_t cudaGraphInstantiate(cudaGraphExec_t* executable, cudaGraph_t graph, unsigned long long flags = 0);
cudaError_t cudaGraphLaunch(cudaGraphExec_t executable, cudaStream_t stream);
cudaError_t cudaGraphDestroy(cudaGraph_t graph);
cudaError_t cudaGraphExecDestroy(cudaGraphExec_t executable);
cudaError_t cudaEventCreate(cudaEvent_t* event);
cudaError_t cudaEventDestroy(cudaEvent_t event);
cudaError_t cudaEventRecord(cudaEvent_t event, cudaStream_t stream = nullptr);
cudaError_t cudaEventSynchronize(cudaEvent_t event);
cudaError_t cudaEventElapsedTime(float* milliseconds, cudaEvent_t start, cudaEvent_t end);
cudaError_t cudaFuncSetAttribute(const void* kernel, cudaFuncAttribute attribute, int value);
template <class T>
cudaError_t cudaMalloc(T** p, size_t bytes) {
  return cudaMalloc(reinterpret_cast<void**>(p), bytes);
}
template <class T>
cudaError_t cudaMallocHost(T** p, size_t bytes) {
  return cudaMallocHost(reinterpret_cast<void**>(p), bytes);
}
template <class... Args>
cudaError_t cudaFuncSetAttribute(void (*kernel)(Args...), cudaFuncAttribute attribute, int value) {
  return cudaFuncSetAttribute(reinterpret_cast<const void*>(kernel), attribute, value);
}
// NOLINTEND

namespace romap::cuda_on_host {

// Checks the launch against the limits of a device (1024 threads, grid sides, dynamic shared memory of 48 KB or what
// cudaFuncSetAttribute allowed for `kernel`) and adds `body`, the work of one thread, to the stream. A rejected launch
// sets cudaErrorInvalidConfiguration.
void LaunchBody(const void* kernel, dim3 grid, dim3 block, size_t dynamic_shared_bytes, cudaStream_t stream,
                std::function<void()> body);

// Launches the kernel with copies of the arguments, as in CUDA.
template <class... Params, class... Args>
void Launch(void (*kernel)(Params...), dim3 grid, dim3 block, size_t dynamic_shared_bytes, cudaStream_t stream,
            Args&&... args) {
  LaunchBody(reinterpret_cast<const void*>(kernel), grid, block, dynamic_shared_bytes, stream,
             [kernel, copies = std::tuple<std::decay_t<Params>...>(args...)] { std::apply(kernel, copies); });
}

// Adds an operation to a stream: executed immediately on the default stream, recorded while the stream captures, and
// otherwise executed at the next synchronization.
cudaError_t Enqueue(cudaStream_t stream, std::function<cudaError_t()> operation);
// Executes the pending operations of all streams.
cudaError_t FinishAllStreams();

// Properties of the emulated machine. Setting them also clears the last error and the failure of the device.
struct DeviceTraits {
  int devices = 1;  // 0: every call fails with cudaErrorNoDevice
  size_t memory_bytes = size_t{1} << 32;
  // Number of kernels that succeed; the next one fails like an invalid memory access, and, as on a real device, every
  // later call fails too. Negative: no failure.
  int kernels_before_fault = -1;
};
void SetDeviceTraits(const DeviceTraits& traits);

// cudaErrorLaunchFailure once the device has failed, else cudaSuccess.
cudaError_t DeviceFault();

size_t AllocatedBytes();
bool InDeviceMemory(uintptr_t address);

}  // namespace romap::cuda_on_host
