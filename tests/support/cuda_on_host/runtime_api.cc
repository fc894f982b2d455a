#include "tests/support/cuda_on_host/runtime_api.h"

#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <utility>

#include "tests/support/cuda_on_host/block_runner.h"

namespace romap::cuda_on_host {
namespace {

constexpr size_t kDefaultSharedBytes = 48 * 1024;
constexpr unsigned kMaxGridYZ = 65535;
constexpr unsigned kMaxBlockZ = 64;

struct Machine {
  std::mutex mutex;
  DeviceTraits traits;
  cudaError_t last_error = cudaSuccess;
  bool lost = false;
  std::map<uintptr_t, size_t> allocations;  // address -> bytes
  size_t allocated_bytes = 0;
  std::map<const void*, size_t> shared_limits;  // of kernels that requested more than the default
};

Machine& TheMachine() {
  static Machine machine;
  return machine;
}

cudaError_t Fail(cudaError_t error) {
  TheMachine().last_error = error;
  return error;
}

// Whether [address, address + bytes) lies within one allocation. The caller holds the mutex.
bool IsAllocated(uintptr_t address, size_t bytes) {
  const auto& allocations = TheMachine().allocations;
  auto next = allocations.upper_bound(address);
  if (next == allocations.begin()) return false;
  const auto& [begin, size] = *--next;
  return address + bytes <= begin + size;
}

// The caller holds the mutex.
cudaError_t CheckDevice() {
  if (TheMachine().traits.devices == 0) return Fail(cudaErrorNoDevice);
  return TheMachine().lost ? Fail(cudaErrorLaunchFailure) : cudaSuccess;
}

// Checks an address that was passed to the API; see IsAllocated.
cudaError_t CheckDevice(const void* p, size_t bytes) {
  std::lock_guard lock(TheMachine().mutex);
  if (const cudaError_t error = CheckDevice()) return error;
  if (bytes > 0 && !IsAllocated(reinterpret_cast<uintptr_t>(p), bytes)) return Fail(cudaErrorInvalidValue);
  return cudaSuccess;
}

bool FitsDevice(const void* kernel, dim3 grid, dim3 block, size_t dynamic_shared_bytes) {
  const uint64_t threads = uint64_t{block.x} * block.y * block.z;
  if (threads == 0 || threads > kMaxThreadsPerBlock || block.z > kMaxBlockZ) return false;
  if (grid.x == 0 || grid.x > 0x7fffffffu || grid.y == 0 || grid.y > kMaxGridYZ || grid.z == 0 || grid.z > kMaxGridYZ) {
    return false;
  }
  const auto& limits = TheMachine().shared_limits;
  const auto own = limits.find(kernel);
  return dynamic_shared_bytes <= (own == limits.end() ? kDefaultSharedBytes : own->second);
}

}  // namespace

// Runs a kernel, unless DeviceTraits make it fail.
cudaError_t RunKernel(dim3 grid, dim3 block, size_t dynamic_shared_bytes, const std::function<void()>& body) {
  {
    std::lock_guard lock(TheMachine().mutex);
    if (const cudaError_t error = CheckDevice()) return error;
    int& remaining = TheMachine().traits.kernels_before_fault;
    if (remaining == 0) {
      TheMachine().lost = true;
      return Fail(cudaErrorLaunchFailure);
    }
    if (remaining > 0) --remaining;
  }
  RunGrid(grid, block, dynamic_shared_bytes, body);
  return cudaSuccess;
}

void LaunchBody(const void* kernel, dim3 grid, dim3 block, size_t dynamic_shared_bytes, cudaStream_t stream,
                std::function<void()> body) {
  {
    std::lock_guard lock(TheMachine().mutex);
    if (CheckDevice() != cudaSuccess) return;
    if (!FitsDevice(kernel, grid, block, dynamic_shared_bytes)) {
      Fail(cudaErrorInvalidConfiguration);
      return;
    }
  }
  Enqueue(stream, [=, body = std::move(body)] { return RunKernel(grid, block, dynamic_shared_bytes, body); });
}

cudaError_t DeviceFault() {
  std::lock_guard lock(TheMachine().mutex);
  return TheMachine().lost ? cudaErrorLaunchFailure : cudaSuccess;
}

void SetDeviceTraits(const DeviceTraits& traits) {
  std::lock_guard lock(TheMachine().mutex);
  TheMachine().traits = traits;
  TheMachine().last_error = cudaSuccess;
  TheMachine().lost = false;
}

size_t AllocatedBytes() {
  std::lock_guard lock(TheMachine().mutex);
  return TheMachine().allocated_bytes;
}

bool InDeviceMemory(uintptr_t address) {
  std::lock_guard lock(TheMachine().mutex);
  return IsAllocated(address, 1);
}

}  // namespace romap::cuda_on_host

using romap::cuda_on_host::CheckDevice;
using romap::cuda_on_host::Fail;
using romap::cuda_on_host::TheMachine;

const char* cudaGetErrorString(cudaError_t error) {
  switch (error) {
    case cudaSuccess:
      return "no error";
    case cudaErrorInvalidValue:
      return "invalid argument";
    case cudaErrorMemoryAllocation:
      return "out of memory";
    case cudaErrorInvalidConfiguration:
      return "invalid configuration argument";
    case cudaErrorNoDevice:
      return "no CUDA-capable device is detected";
    case cudaErrorLaunchFailure:
      return "unspecified launch failure";
    case cudaErrorStreamCaptureUnsupported:
      return "operation not permitted when stream is capturing";
  }
  return "unrecognized error code";
}

cudaError_t cudaPeekAtLastError() {
  std::lock_guard lock(TheMachine().mutex);
  return TheMachine().last_error;
}

cudaError_t cudaGetLastError() {
  std::lock_guard lock(TheMachine().mutex);
  return std::exchange(TheMachine().last_error, cudaSuccess);
}

cudaError_t cudaGetDeviceCount(int* count) {
  std::lock_guard lock(TheMachine().mutex);
  *count = TheMachine().traits.devices;
  return *count > 0 ? cudaSuccess : Fail(cudaErrorNoDevice);
}

cudaError_t cudaSetDevice(int device) {
  std::lock_guard lock(TheMachine().mutex);
  return device >= 0 && device < TheMachine().traits.devices ? cudaSuccess : Fail(cudaErrorInvalidValue);
}

cudaError_t cudaGetDeviceProperties(cudaDeviceProp* properties, int device) {
  std::lock_guard lock(TheMachine().mutex);
  if (device < 0 || device >= TheMachine().traits.devices) return Fail(cudaErrorInvalidValue);
  *properties = {.name = "this host", .major = 8, .minor = 0, .multiProcessorCount = 4};
  return cudaSuccess;
}

cudaError_t cudaMalloc(void** p, size_t bytes) {
  std::lock_guard lock(TheMachine().mutex);
  *p = nullptr;
  if (const cudaError_t error = CheckDevice()) return error;
  if (bytes == 0) return cudaSuccess;
  if (TheMachine().allocated_bytes + bytes > TheMachine().traits.memory_bytes) return Fail(cudaErrorMemoryAllocation);
  constexpr size_t kAlignment = 256;
  *p = std::aligned_alloc(kAlignment, (bytes + kAlignment - 1) / kAlignment * kAlignment);
  if (*p == nullptr) return Fail(cudaErrorMemoryAllocation);
  std::memset(*p, 0xff, bytes);  // NaN: kernels must not rely on zeros
  TheMachine().allocations[reinterpret_cast<uintptr_t>(*p)] = bytes;
  TheMachine().allocated_bytes += bytes;
  return cudaSuccess;
}

cudaError_t cudaFree(void* p) {
  if (p == nullptr) return cudaSuccess;
  std::lock_guard lock(TheMachine().mutex);
  const auto found = TheMachine().allocations.find(reinterpret_cast<uintptr_t>(p));
  if (found == TheMachine().allocations.end()) return Fail(cudaErrorInvalidValue);
  TheMachine().allocated_bytes -= found->second;
  TheMachine().allocations.erase(found);
  std::free(p);
  return CheckDevice();
}

cudaError_t cudaMallocHost(void** p, size_t bytes) {
  std::lock_guard lock(TheMachine().mutex);
  *p = nullptr;
  if (const cudaError_t error = CheckDevice()) return error;
  if (bytes == 0) return cudaSuccess;
  *p = std::malloc(bytes);
  if (*p == nullptr) return Fail(cudaErrorMemoryAllocation);
  std::memset(*p, 0xff, bytes);
  return cudaSuccess;
}

cudaError_t cudaFreeHost(void* p) {
  std::free(p);
  return cudaSuccess;
}

cudaError_t cudaMemset(void* p, int value, size_t bytes) {
  if (const cudaError_t error = CheckDevice(p, bytes)) return error;
  if (bytes > 0) std::memset(p, value, bytes);
  return cudaSuccess;
}

cudaError_t cudaMemcpy(void* to, const void* from, size_t bytes, cudaMemcpyKind kind) {
  if (kind == cudaMemcpyHostToDevice || kind == cudaMemcpyDeviceToDevice) {
    if (const cudaError_t error = CheckDevice(to, bytes)) return error;
  }
  if (kind == cudaMemcpyDeviceToHost || kind == cudaMemcpyDeviceToDevice) {
    if (const cudaError_t error = CheckDevice(from, bytes)) return error;
  }
  if (bytes > 0) std::memmove(to, from, bytes);
  return cudaSuccess;
}

cudaError_t cudaFuncSetAttribute(const void* kernel, cudaFuncAttribute, int value) {
  constexpr int kMaxSharedBytes = 99 * 1024;  // of the smaller devices since compute capability 8.0
  std::lock_guard lock(TheMachine().mutex);
  if (value < 0 || value > kMaxSharedBytes) return Fail(cudaErrorInvalidValue);
  TheMachine().shared_limits[kernel] = static_cast<size_t>(value);
  return cudaSuccess;
}
