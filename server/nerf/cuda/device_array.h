#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <span>
#include <string>
#include <utility>

#include "common/status.h"
#include "server/nerf/cuda/cuda_launch.h"

namespace romap::nerf::cuda {

// OK, or "CUDA: cannot <doing>: <message of CUDA>": RESOURCE_EXHAUSTED if the device is out of memory, which does not
// affect other fields; UNAVAILABLE for all errors after which the device may be unusable.
inline absl::Status ToStatus(cudaError_t error, const char* doing) {
  if (error == cudaSuccess) return absl::OkStatus();
  cudaGetLastError();  // clears the error, or the next launch would report it again
  const std::string what = fmt::format("CUDA: cannot {}: {}", doing, cudaGetErrorString(error));
  return error == cudaErrorMemoryAllocation ? absl::ResourceExhaustedError(what) : absl::UnavailableError(what);
}

inline absl::Status CopyToDevice(void* to, const void* from, size_t bytes, cudaStream_t stream) {
  return ToStatus(cudaMemcpyAsync(to, from, bytes, cudaMemcpyHostToDevice, stream), "copy to the device");
}
inline absl::Status CopyToHost(void* to, const void* from, size_t bytes, cudaStream_t stream) {
  return ToStatus(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToHost, stream), "copy from the device");
}
inline absl::Status Synchronize(cudaStream_t stream) {
  return ToStatus(cudaStreamSynchronize(stream), "train a field");
}

// Memory of an array: on the device, or page-locked on the host for direct copies by the device.
enum class MemoryKind { kDevice, kPinned };

// Owns an array.
template <class T, MemoryKind kKind>
class CudaArray {
 public:
  CudaArray() = default;
  CudaArray(CudaArray&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}
  CudaArray& operator=(CudaArray&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    return *this;
  }
  ~CudaArray() {
    if (data_ != nullptr) kKind == MemoryKind::kDevice ? cudaFree(data_) : cudaFreeHost(data_);
  }

  // The values are uninitialized.
  static absl::StatusOr<CudaArray> Allocate(size_t count) {
    CudaArray array;
    array.size_ = count;
    const size_t bytes = count * sizeof(T);
    ROMAP_RETURN_IF_ERROR(
        ToStatus(kKind == MemoryKind::kDevice ? cudaMalloc(&array.data_, bytes) : cudaMallocHost(&array.data_, bytes),
                 "allocate memory"));
    return array;
  }
  static absl::StatusOr<CudaArray> CopyOf(std::span<const T> values) {
    ROMAP_ASSIGN_OR_RETURN(CudaArray array, Allocate(values.size()));
    ROMAP_RETURN_IF_ERROR(ToStatus(cudaMemcpy(array.data_, values.data(), values.size_bytes(), cudaMemcpyHostToDevice),
                                   "copy to the device"));
    return array;
  }
  // Waits for earlier launches on the default stream. INVALID_ARGUMENT if the lengths differ.
  absl::Status Read(std::span<T> values) const {
    if (values.size() != size_)
      return InvalidArgument("CUDA: cannot read {} values from an array of {}", values.size(), size_);
    return ToStatus(cudaMemcpy(values.data(), data_, values.size_bytes(), cudaMemcpyDeviceToHost),
                    "copy from the device");
  }

  T* data() { return data_; }
  const T* data() const { return data_; }
  size_t size() const { return size_; }
  size_t bytes() const { return size_ * sizeof(T); }

 private:
  T* data_ = nullptr;
  size_t size_ = 0;
};

template <class T>
using DeviceArray = CudaArray<T, MemoryKind::kDevice>;
template <class T>
using PinnedArray = CudaArray<T, MemoryKind::kPinned>;

}  // namespace romap::nerf::cuda
