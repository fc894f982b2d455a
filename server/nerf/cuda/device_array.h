#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <span>
#include <utility>

#include "common/status.h"
#include "server/nerf/cuda/cuda_launch.h"

namespace romap::nerf::cuda {

// UNAVAILABLE "CUDA: cannot <doing>: <CUDA's words>", or OK.
inline absl::Status ToStatus(cudaError_t error, const char* doing) {
  if (error == cudaSuccess) return absl::OkStatus();
  cudaGetLastError();  // else the next launch would report this error once more
  return absl::UnavailableError(fmt::format("CUDA: cannot {}: {}", doing, cudaGetErrorString(error)));
}

// Owns an array in device memory.
template <class T>
class DeviceArray {
 public:
  DeviceArray() = default;
  DeviceArray(DeviceArray&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}
  DeviceArray& operator=(DeviceArray&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    return *this;
  }
  ~DeviceArray() {
    if (data_ != nullptr) cudaFree(data_);
  }

  // Not initialised.
  static absl::StatusOr<DeviceArray> Allocate(size_t count) {
    DeviceArray array;
    array.size_ = count;
    ROMAP_RETURN_IF_ERROR(ToStatus(cudaMalloc(&array.data_, count * sizeof(T)), "allocate memory"));
    return array;
  }
  static absl::StatusOr<DeviceArray> CopyOf(std::span<const T> values) {
    ROMAP_ASSIGN_OR_RETURN(DeviceArray array, Allocate(values.size()));
    ROMAP_RETURN_IF_ERROR(
        ToStatus(cudaMemcpy(array.data_, values.data(), values.size_bytes(), cudaMemcpyHostToDevice), "copy to it"));
    return array;
  }
  // Waits for the launches before it; `values` must be as long as the array.
  absl::Status Read(std::span<T> values) const {
    if (values.size() != size_) return InvalidArgument("CUDA: read {} values of {}", values.size(), size_);
    return ToStatus(cudaMemcpy(values.data(), data_, values.size_bytes(), cudaMemcpyDeviceToHost), "copy from it");
  }

  T* data() { return data_; }
  const T* data() const { return data_; }
  size_t size() const { return size_; }

 private:
  T* data_ = nullptr;
  size_t size_ = 0;
};

}  // namespace romap::nerf::cuda
