#include "client/eval/pcg64.h"

#include <algorithm>
#include <array>
#include <bit>
#include <numeric>
#include <utility>

namespace romap::eval {
namespace {

// Spreads one seed over 256 bits as NumPy's SeedSequence does (after O'Neill, "Developing a seed_seq alternative",
// 2015).
class SeedSequence {
 public:
  explicit SeedSequence(uint32_t seed) {
    uint32_t multiplier = 0x43b0d7e5;
    const auto hash = [&](uint32_t value) {
      value ^= multiplier;
      multiplier *= 0x931e8875;
      value *= multiplier;
      return value ^ (value >> 16);
    };
    for (size_t k = 0; k < pool_.size(); ++k) pool_[k] = hash(k == 0 ? seed : 0);
    for (size_t from = 0; from < pool_.size(); ++from) {
      for (size_t to = 0; to < pool_.size(); ++to) {
        if (from == to) continue;
        const uint32_t mixed = 0xca01f9dd * pool_[to] - 0x4973f715 * hash(pool_[from]);
        pool_[to] = mixed ^ (mixed >> 16);
      }
    }
  }

  // Four 64-bit words of state, low half first.
  std::array<uint64_t, 4> State() const {
    std::array<uint64_t, 4> state{};
    uint32_t multiplier = 0x8b51f9dd;
    for (size_t k = 0; k < 2 * state.size(); ++k) {
      uint32_t value = pool_[k % pool_.size()] ^ multiplier;
      multiplier *= 0x58f38ded;
      value *= multiplier;
      value ^= value >> 16;
      state[k / 2] |= static_cast<uint64_t>(value) << (32 * (k % 2));
    }
    return state;
  }

 private:
  std::array<uint32_t, 4> pool_{};
};

}  // namespace

Pcg64::Pcg64(uint32_t seed) {
  const std::array<uint64_t, 4> state = SeedSequence(seed).State();
  increment_ = (((Uint128{state[2]} << 64) | state[3]) << 1) | 1;
  Next64();
  state_ += (Uint128{state[0]} << 64) | state[1];
  Next64();
}

uint64_t Pcg64::Next64() {
  constexpr Uint128 kMultiplier = (Uint128{2549297995355413924u} << 64) | 4865540595714422341u;
  state_ = state_ * kMultiplier + increment_;
  const uint64_t folded = static_cast<uint64_t>(state_ >> 64) ^ static_cast<uint64_t>(state_);
  return std::rotr(folded, static_cast<int>(state_ >> 122));
}

double Pcg64::NextUniform() { return static_cast<double>(Next64() >> 11) * 0x1p-53; }

uint32_t Pcg64::Next32() {
  if (std::exchange(has_half_, !has_half_)) return half_;
  const uint64_t both = Next64();
  half_ = static_cast<uint32_t>(both >> 32);
  return static_cast<uint32_t>(both);
}

uint32_t Pcg64::NextBounded(uint32_t bound) {
  if (bound == 0) return 0;
  const uint32_t choices = bound + 1;
  uint64_t product = uint64_t{Next32()} * choices;
  const uint32_t threshold = (UINT32_MAX - bound) % choices;
  while (static_cast<uint32_t>(product) < threshold) product = uint64_t{Next32()} * choices;
  return static_cast<uint32_t>(product >> 32);
}

std::vector<uint32_t> Pcg64::Choose(uint32_t size, uint32_t count) {
  std::vector<uint32_t> numbers(size);
  std::iota(numbers.begin(), numbers.end(), 0);
  const uint32_t stop = std::max<uint32_t>(size - count, 1);
  for (uint32_t k = size; k-- > stop;) std::swap(numbers[k], numbers[NextBounded(k)]);
  return {numbers.end() - count, numbers.end()};
}

}  // namespace romap::eval
