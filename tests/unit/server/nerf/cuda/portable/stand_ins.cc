// Replacements for libraries that cannot be linked statically.
#include <hwy/aligned_allocator.h>

#include <cstdlib>

#include "server/nerf/cpu/kernels.h"

namespace hwy {

// Replaces Highway's allocation, without support for custom allocators.
void* AllocateAlignedBytes(size_t payload_size, AllocPtr, void*) {
  return std::aligned_alloc(HWY_ALIGNMENT, (payload_size + HWY_ALIGNMENT - 1) / HWY_ALIGNMENT * HWY_ALIGNMENT);
}
void FreeAlignedBytes(const void* aligned_pointer, FreePtr, void*) { std::free(const_cast<void*>(aligned_pointer)); }

}  // namespace hwy

namespace romap::nerf {

// The CPU is only the reference for the device here.
const KernelTable& SimdKernels() { return PlainKernels(); }

}  // namespace romap::nerf
