#pragma once

#include <cmath>
#include <cstdint>

namespace romap::synth {

// Hashes 64 bits with the finalizer of SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number
// generators", 2014).
inline uint64_t Scramble(uint64_t x) {
  x += 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31);
}

// A stream of random numbers that is determined by (seed, stream). Does not use the distributions of the standard
// library, which differ between implementations, so that sequences are identical everywhere.
class Random {
 public:
  explicit Random(uint64_t seed, uint64_t stream = 0) : state_(Scramble(seed) ^ Scramble(~stream)) {}

  uint64_t Bits() { return Scramble(state_ += 0x9E3779B97F4A7C15ULL); }
  // [0, 1)
  double Uniform() { return static_cast<double>(Bits() >> 11) * 0x1.0p-53; }
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }
  float UniformFloat(double low, double high) { return static_cast<float>(Uniform(low, high)); }
  // 0 .. count - 1
  int Below(int count) { return static_cast<int>(Bits() % static_cast<uint64_t>(count)); }
  bool Chance(double probability) { return Uniform() < probability; }
  // Standard normal (Box-Muller).
  double Normal() {
    const double radius = std::sqrt(-2 * std::log(1 - Uniform()));
    return radius * std::cos(6.283185307179586 * Uniform());
  }

 private:
  uint64_t state_;
};

}  // namespace romap::synth
