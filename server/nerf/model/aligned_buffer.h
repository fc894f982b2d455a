#pragma once

#include <hwy/aligned_allocator.h>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <new>
#include <span>

namespace romap::nerf {

// Array of T, zero-initialized, aligned for vector loads, of fixed length.
template <class T>
class AlignedBuffer {
 public:
  AlignedBuffer() = default;
  explicit AlignedBuffer(size_t count) : count_(count) {
    if (count == 0) return;  // Highway's allocator rejects empty arrays
    data_ = hwy::AllocateAligned<T>(count);
    if (!data_) throw std::bad_alloc();
    std::uninitialized_value_construct_n(data(), count_);
  }
  AlignedBuffer(AlignedBuffer&&) noexcept = default;
  AlignedBuffer& operator=(AlignedBuffer&&) noexcept = default;

  AlignedBuffer Clone() const {
    AlignedBuffer copy(count_);
    std::copy_n(data(), count_, copy.data());
    return copy;
  }

  T* data() { return data_.get(); }
  const T* data() const { return data_.get(); }
  size_t size() const { return count_; }
  T& operator[](size_t i) { return data_[i]; }
  const T& operator[](size_t i) const { return data_[i]; }
  std::span<const T> span() const { return {data(), count_}; }

 private:
  hwy::AlignedFreeUniquePtr<T[]> data_;
  size_t count_ = 0;
};

}  // namespace romap::nerf
