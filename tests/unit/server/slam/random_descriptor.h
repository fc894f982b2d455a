#pragma once

#include <cstdint>
#include <random>

#include "server/slam/features/feature.h"

namespace romap::slam {

inline Descriptor RandomDescriptor(std::mt19937_64& random) {
  Descriptor descriptor;
  for (uint64_t& word : descriptor) word = random();
  return descriptor;
}

// The descriptor with `bits` bits (0..256) inverted.
inline Descriptor Flip(Descriptor descriptor, int bits) {
  for (int i = 0; i < bits; ++i) descriptor[static_cast<size_t>(i) % 4] ^= uint64_t{1} << (i / 4);
  return descriptor;
}

}  // namespace romap::slam
