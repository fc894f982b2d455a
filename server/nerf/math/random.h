#pragma once

#include <cstdint>

#include "server/nerf/math/target.h"

namespace romap::nerf {

// Counter-based random numbers: the same (seed, a, b) gives the same number on every back end and in every order of
// evaluation. The mixer is the finalizer of splitmix64 (Steele, Lea, Flood: "Fast splittable pseudorandom number
// generators", 2014).
ROMAP_HD uint64_t MixBits(uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

ROMAP_HD uint64_t RandomBits(uint64_t seed, uint64_t a, uint64_t b) { return MixBits(MixBits(MixBits(seed) + a) + b); }

// Uniform in [0, 1).
ROMAP_HD float RandomUniform(uint64_t seed, uint64_t a, uint64_t b) {
  return static_cast<float>(RandomBits(seed, a, b) >> 40) * (1.0f / 16777216.0f);
}

}  // namespace romap::nerf
