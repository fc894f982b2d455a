#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>

namespace romap::slam {

// Draws K different indices below `count` (count >= K). Uses modulo, because the standard distributions differ between
// libraries and the same seed must give the same map on every platform.
template <int K>
std::array<int, K> SampleDistinct(int count, std::mt19937_64& random) {
  std::array<int, K> sample;
  for (int k = 0; k < K; ++k) {
    const auto chosen_end = sample.begin() + k;
    do {
      sample[k] = static_cast<int>(random() % static_cast<uint64_t>(count));
    } while (std::find(sample.begin(), chosen_end, sample[k]) != chosen_end);
  }
  return sample;
}

// Number of samples of `size` matches that RANSAC needs for a 99.9 % chance of one sample without outliers (Fischler
// and Bolles 1981), at most `limit`.
inline int SamplesNeeded(double inlier_share, int size, int limit) {
  constexpr double kLogFailureProbability = -6.907755;  // log(0.001)
  const double probability = std::pow(inlier_share, size);
  if (probability >= 1) return 1;
  const double needed = std::ceil(kLogFailureProbability / std::log1p(-probability));
  return needed < limit ? std::max(1, static_cast<int>(needed)) : limit;  // also if `needed` is infinite
}

}  // namespace romap::slam
