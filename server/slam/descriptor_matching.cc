#include "server/slam/descriptor_matching.h"

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <limits>

namespace romap::slam {
namespace {

struct BestMatch {
  int index = -1;
  int distance = std::numeric_limits<int>::max();
  int second_distance = std::numeric_limits<int>::max();
};

[[gnu::always_inline]] inline int CountDifferingBits(const Descriptor& a, const Descriptor& b) {
  return __builtin_popcountll(a[0] ^ b[0]) + __builtin_popcountll(a[1] ^ b[1]) + __builtin_popcountll(a[2] ^ b[2]) +
         __builtin_popcountll(a[3] ^ b[3]);
}

// Inlined into both of its callers, so that it is compiled with and without the popcnt instruction.
[[gnu::always_inline]] inline void FindBestImpl(std::span<const Descriptor> first, std::span<const Descriptor> second,
                                                std::vector<BestMatch>& best_of_first,
                                                std::vector<BestMatch>& best_of_second) {
  for (size_t i = 0; i < first.size(); ++i) {
    const Descriptor a = first[i];
    BestMatch best;
    for (size_t k = 0; k < second.size(); ++k) {
      const int distance = CountDifferingBits(a, second[k]);
      if (distance < best.distance) {
        best.second_distance = best.distance;
        best.distance = distance;
        best.index = static_cast<int>(k);
      } else if (distance < best.second_distance) {
        best.second_distance = distance;
      }
      if (distance < best_of_second[k].distance) {
        best_of_second[k].distance = distance;
        best_of_second[k].index = static_cast<int>(i);
      }
    }
    best_of_first[i] = best;
  }
}

#if defined(__x86_64__)
[[gnu::target("popcnt")]] void FindBestWithPopcnt(std::span<const Descriptor> first, std::span<const Descriptor> second,
                                                  std::vector<BestMatch>& best_of_first,
                                                  std::vector<BestMatch>& best_of_second) {
  FindBestImpl(first, second, best_of_first, best_of_second);
}
#endif

void FindBest(std::span<const Descriptor> first, std::span<const Descriptor> second,
              std::vector<BestMatch>& best_of_first, std::vector<BestMatch>& best_of_second) {
#if defined(__x86_64__)
  static const bool has_popcnt = __builtin_cpu_supports("popcnt") != 0;
  if (has_popcnt) return FindBestWithPopcnt(first, second, best_of_first, best_of_second);
#endif
  FindBestImpl(first, second, best_of_first, best_of_second);
}

}  // namespace

std::vector<DescriptorMatch> MatchDescriptors(std::span<const Descriptor> first, std::span<const Descriptor> second,
                                              int max_distance, double ratio) {
  std::vector<BestMatch> best_of_first(first.size());
  std::vector<BestMatch> best_of_second(second.size());
  FindBest(first, second, best_of_first, best_of_second);
  std::vector<DescriptorMatch> matches;
  for (size_t i = 0; i < first.size(); ++i) {
    const BestMatch& best = best_of_first[i];
    if (best.index < 0 || best.distance > max_distance) continue;
    if (best_of_second[static_cast<size_t>(best.index)].index != static_cast<int>(i)) continue;
    if (best.second_distance != std::numeric_limits<int>::max() && best.distance >= ratio * best.second_distance) {
      continue;
    }
    matches.push_back({static_cast<int>(i), best.index, best.distance});
  }
  return matches;
}

NearestFeature FindNearest(const Feature& feature, std::span<const Feature> others, std::span<const int> candidates,
                           int max_octave_difference) {
  NearestFeature nearest;
  for (const int index : candidates) {
    const Feature& other = others[static_cast<size_t>(index)];
    if (std::abs(other.octave - feature.octave) > max_octave_difference) continue;
    const int distance = HammingDistance(feature.descriptor, other.descriptor);
    if (distance < nearest.distance) {
      nearest = {.index = index, .distance = distance, .second_distance = nearest.distance};
    } else {
      nearest.second_distance = std::min(nearest.second_distance, distance);
    }
  }
  return nearest;
}

}  // namespace romap::slam
