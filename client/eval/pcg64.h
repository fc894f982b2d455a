#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace romap::eval {

// The generator PCG64 (XSL-RR 128/64; O'Neill, "PCG: A Family of Simple Fast Space-Efficient Statistically Good
// Algorithms for Random Number Generation", 2014), seeded as NumPy's `default_rng(seed)` is. Evaluation scripts in the
// field sample surfaces with NumPy; the same stream gives the same samples, so that figures can be compared in all
// their digits.
class Pcg64 {
 public:
  explicit Pcg64(uint32_t seed);

  uint64_t Next64();
  double NextUniform();  // in [0, 1), multiples of 2^-53
  // `count` of the numbers 0..size-1 without repetition, in random order: the tail of a Fisher-Yates shuffle that stops
  // early. count <= size < 2^32.
  std::vector<uint32_t> Choose(uint32_t size, uint32_t count);

 private:
  uint32_t Next32();                     // each 64-bit number gives two, low half first
  uint32_t NextBounded(uint32_t bound);  // 0..bound, by Lemire's method (ACM TOMACS 2019)

  using Uint128 = unsigned __int128;
  Uint128 state_ = 0;
  Uint128 increment_ = 0;
  bool has_half_ = false;
  uint32_t half_ = 0;
};

}  // namespace romap::eval
